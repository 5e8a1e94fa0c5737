"""Designs as people and disks spoil them: described in numbers that are numbers, or refused."""

from functools import partial
from importlib import resources

import numpy as np

from fuzzing import broken, cases, changed_toml, check_answer, command, mutated, working_folder

NAMES = ("planar", "optimised")


def answer(content: bytes) -> None:
    with open("d.toml", "wb") as file:
        file.write(content)
    check_answer(command("info", "d.toml", "--json"), as_json=True, names="d.toml")


@cases(6, 1400)
def test_a_spoilt_design_is_described_or_refused(count, tmp_path):
    def drawn():
        rng = np.random.default_rng(1)
        folder = resources.files("smoskin.design")
        texts = [(folder / f"{name}.toml").read_text(encoding="utf-8") for name in NAMES]
        for k in range(count):
            text = texts[k % 2]
            if k % 5 == 4:
                what, content = mutated(text.encode(), rng)
            else:
                what, text = changed_toml(text, rng)
                if k % 7 == 6:
                    second, text = changed_toml(text, rng)
                    what = f"{what}, {second}"
                content = text.encode()
            yield f"{k}: {what}", partial(answer, content)

    with working_folder(tmp_path):
        assert broken(drawn()) == []
