"""Costs of `smoskin serve` end to end: latencies, losses and memory of skins with all their sinks.

Boards in processes of their own send, byte for byte, what made skins read under a hand; `serve`
reads them by tables that fifteen touches of a rig have calibrated, records each, shows it on a live
page and tells a client of the feed, unless ``--no-client``; with ``--browser`` a headless Chromium
has every page open.

``python benchmarks/bench_service.py --rate 200 --seconds 600 --browser``, ``--skins 4 --rate 100``;
with ``--realtime`` the service runs before other programs;
``--soak 180000`` reads recordings as fast as it can and tells the memory along the way.
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import smoskin as smo
from smoskin.commands.serve.skins import Service, wanted_skins
from smoskin.service.apart.realtime import undisturbed
from smoskin.service.bridges.feed import Feed
from smoskin.service.loop import Histogram

SETTLED = 3.0
"""s after which losses and latencies count."""
SOAKED = 30.0
"""s of a hand in a recording that is read again and again."""
UNTOUCHED = 15.0
"""s before the hand for each skin, which are opened one by one: no touch is taken for a zero."""
ROUND = 60.0
"""s after which the hand does the same again, and so do the readings of longer recordings."""
SPARE = 10.0
"""s of the hand after all is measured: a board that begins again sends a jump no skin makes."""
BOARD = """
import sys, smoskin as smo
from smoskin.hardware.board import VirtualBoard
with VirtualBoard(smo.open_source(sys.argv[1])) as board:
    print(board.port, flush=True)
    while True:
        while board.watched and board.step():
            pass
        board.restart(smo.open_source(sys.argv[1]))
"""
CLIENT = """
import json, sys
from websockets.sync.client import connect
with connect(sys.argv[1]) as feed:
    feed.recv()
    heard = {}
    for message in map(json.loads, feed):
        first, last, count = heard.get(message["skin"], (message["sequence"], 0, 0))
        heard[message["skin"]] = first, message["sequence"], count + 1
for skin, (first, last, count) in heard.items():
    print(f"a client of the feed heard {count} of {last - first + 1} of {skin}")
"""


def resident() -> float:
    """Memory of this process that is in use, MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def make(folder: Path, seed: int, rate: float, untouched: float, touched: float) -> None:
    """A made skin's table, and a recording of what it reads under a hand."""
    design = smo.load_design("planar")
    skin = smo.calibrate(
        smo.load_response_table("planar"), smo.VirtualRig(design, seed=seed), count=15
    )
    skin.table.save(folder / f"s{seed}.table")
    url = f"twin://planar?manufactured=yes&seed={seed}&speed=max&rate={rate:g}"
    readings = []
    for seconds, hand in ((untouched, "no"), (min(touched, 2 * ROUND), "yes")):
        with smo.open_source(f"{url}&hand={hand}") as source:
            readings += [source.read() for _ in range(round(seconds * rate))]
    whole, again = round((untouched + touched) * rate), round(ROUND * rate)
    with smo.Recorder(folder / f"s{seed}.mcap", design) as sink:
        for index in range(whole):
            sink.write(replace(readings[index], time=index / rate))
            if index + again >= len(readings):
                readings.append(readings[index])


def board(stack: ExitStack, url: str) -> str:
    """A board that sends a recording, until the stack ends; its port."""
    process = subprocess.Popen([sys.executable, "-c", BOARD, url], stdout=subprocess.PIPE)
    stack.callback(process.wait)
    stack.callback(process.kill)
    return process.stdout.readline().decode().strip()


def look(stack: ExitStack, urls: list[str]) -> None:
    """Open pages in a headless browser that stays until the stack ends."""
    from playwright.sync_api import sync_playwright

    browser = stack.enter_context(sync_playwright()).chromium.launch(
        executable_path="/usr/bin/chromium", args=["--no-sandbox", "--use-gl=swiftshader"]
    )
    stack.callback(browser.close)
    for url in urls:
        browser.new_page(viewport={"width": 800, "height": 600}).goto(url)


def main() -> None:
    """Serve skins, and tell what it cost."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rate", type=float, default=200.0)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--skins", type=int, default=1)
    parser.add_argument("--browser", action="store_true")
    parser.add_argument("--client", action=argparse.BooleanOptionalAction, default=True)
    parser.add_argument("--realtime", action="store_true")
    parser.add_argument("--soak", type=int, default=0)
    options = parser.parse_args()
    with TemporaryDirectory() as name, ExitStack() as stack:
        folder = Path(name)
        # In a process of its own: the solver's libraries are none of the service's.
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as maker:
            touched = SOAKED if options.soak else options.seconds + SPARE
            lasts = options.rate, UNTOUCHED * options.skins, touched
            for seed in range(options.skins):
                maker.submit(make, folder, seed, *lasts).result()
        recordings = [f"replay:{folder}/s{seed}.mcap" for seed in range(options.skins)]
        feed = stack.enter_context(Feed())
        if options.soak:
            soak(folder, feed, recordings, options.soak)
            return
        sources = [f"s{k}=serial://{board(stack, url)}" for k, url in enumerate(recordings)]
        files = [f"s{seed}={folder}/s{seed}.table" for seed in range(options.skins)]
        (folder / "kept").mkdir()
        wanted = wanted_skins(sources, files, folder / "kept")
        service = stack.enter_context(Service(wanted, [feed], view=True))
        if options.client:
            stack.callback(subprocess.Popen([sys.executable, "-c", CLIENT, feed.url]).wait)
            stack.callback(feed.close)
        if options.browser:
            look(stack, [str(skin.watch.url) for skin in service.skins.values()])
        stack.enter_context(undisturbed(realtime=options.realtime))
        begun, used, before = time.monotonic(), time.process_time(), None
        for counters in service.run(options.seconds, every=SETTLED):
            if before is None:  # what browsers and pages cost to begin is not what is asked
                before = counters
                for skin in service.skins.values():
                    skin.watch._loop._stages.update(estimate=Histogram(), sinks=Histogram())
        elapsed, used = time.monotonic() - begun, time.process_time() - used
        print(f"{elapsed:.0f} s, {100 * used / elapsed:.0f} % of a core, {resident():.0f} MB")
        for name, counts in service.counters().items():
            lost = {
                key: counts[key] - (before or {}).get(name, counts)[key]
                for key in ("skipped", "lost", "dropped", "not_recorded")
            }
            begun_with = (before or {}).get(name, counts)["line"]
            lost["overtaken"] = counts["line"]["dropped"] - begun_with["dropped"]
            print(
                f"{name}: {counts['readings']} readings at {counts['rate_hz']} Hz,",
                json.dumps(lost),
            )
            print(f"  {json.dumps(counts['statuses'])}\n  ms: {json.dumps(counts['stages_ms'])}")


def soak(folder: Path, feed: Feed, recordings: list[str], readings: int) -> None:
    """Read so many readings as fast as they come, again and again, and tell the memory.

    Each opening has a thread of its own and so, in glibc, up to eight a core a heap of its own:
    run with ``MALLOC_ARENA_MAX=1`` to see what stays.
    """
    done, place = 0, 0
    files = [f"{folder}/s{seed}.table" for seed in range(len(recordings))]
    while done < readings:
        sources = [f"{place}-{k}={url}?speed=max" for k, url in enumerate(recordings)]
        sources = [f"s{source}" for source in sources]
        named = [f"s{place}-{k}={file}" for k, file in enumerate(files)]
        with Service(wanted_skins(sources, named), [feed]) as service:
            for _ in service.run(every=1e9):
                pass
            done += sum(counts["readings"] for counts in service.counters().values())
        place += 1
        print(f"{done} readings, {resident():.1f} MB", flush=True)


if __name__ == "__main__":
    main()
