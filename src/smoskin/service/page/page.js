"use strict";
(() => {
  // The viewer takes its theme from the address; the system's changes count at once.
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const paint = () => {
    const address = new URL(location.href);
    if (address.searchParams.has("darkMode") === dark.matches) return false;
    if (dark.matches) address.searchParams.set("darkMode", "");
    else address.searchParams.delete("darkMode");
    history.replaceState(null, "", address);
    return true;
  };
  paint();
  if (innerWidth < 0.8 * innerHeight) {
    const { eye, aim } = document.getElementById("skin-title").dataset;
    const address = new URL(location.href);
    address.searchParams.set("initialCameraPosition", eye);
    address.searchParams.set("initialCameraLookAt", aim);
    history.replaceState(null, "", address);
  }
  dark.addEventListener("change", () => paint() && location.reload());

  // The viewer waits for a drag to begin; a press begins when the button goes down.
  addEventListener("pointerdown", (down) => {
    if (!(down.target instanceof HTMLCanvasElement)) return;
    const { pointerId, clientX, clientY, shiftKey, ctrlKey, metaKey, altKey } = down;
    const nudge = { pointerId, clientX: clientX + 20, clientY, shiftKey, ctrlKey, metaKey, altKey };
    setTimeout(() => dispatchEvent(new PointerEvent("pointermove", nudge)));
  });
  addEventListener("contextmenu", (event) => {
    if (event.target instanceof HTMLCanvasElement) event.preventDefault();
  });

  // A button that is held is let go where the page goes out of sight or another window comes before it.
  let down = null;
  addEventListener("pointerdown", (event) => { down = event; }, true);
  const letGo = () => down?.target.dispatchEvent(
    new PointerEvent("pointercancel", { bubbles: true, pointerId: down.pointerId }));
  document.addEventListener("visibilitychange", () => document.hidden && letGo());
  addEventListener("blur", letGo);

  // A box beside a slider shows what was typed, within the slider's ends; else what it held.
  const sliderOf = (box) => box instanceof HTMLInputElement && box.closest(".mantine-NumberInput-root")
    ?.parentElement.querySelector('[role="slider"]');
  let held = "", pending = 0;
  addEventListener("focusin", (event) => {
    const slider = sliderOf(event.target);
    if (!slider) return;
    clearTimeout(pending);
    held = slider.getAttribute("aria-valuenow");
  });
  addEventListener("focusout", (event) => {
    const box = event.target, slider = sliderOf(box);
    if (!slider) return;
    const end = (name) => Number(slider.getAttribute(`aria-value${name}`)), before = held;
    pending = setTimeout(() => {
      const typed = box.value.trim() === "" ? NaN : Number(box.value);
      const meant = Number.isFinite(typed) ? Math.min(Math.max(typed, end("min")), end("max")) : Number(before);
      if (typed === meant) return;
      Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set.call(box, String(meant));
      box.dispatchEvent(new Event("input", { bubbles: true }));
    }, 100);
  });

  // Keys press the buttons that people see; not while something else takes the key.
  const keys = { z: ["Zero"], r: ["Record", "Stop recording"], " ": ["Pause", "Go on"] };
  addEventListener("keydown", (key) => {
    if (key.ctrlKey || key.metaKey || key.altKey || key.repeat) return;
    if (key.target.closest?.("input, textarea, button, [role]")) return;
    if (key.key === "?") document.getElementById("skin-keys").toggleAttribute("hidden");
    const names = keys[key.key] ?? [];
    const button = [...document.querySelectorAll("button")].find((each) => names.includes(each.textContent.trim()));
    if (button && !button.disabled) { key.preventDefault(); button.click(); }
  });

  const said = (name) => document.querySelector(`[data-name="${name}"]`)?.textContent.trim() ?? "";
  let folded = false;
  setInterval(() => {
    const status = said("status");
    if (!status) return;
    document.getElementById("skin-loading").hidden = true;
    const sheet = document.querySelector('.mantine-Paper-root[style*="position: fixed"]');
    // What an operator needs at once stays open.
    if (!folded && !document.querySelector(".skin-arm")) sheet?.querySelector('div[style*="height: 3.5em"]')?.click();
    folded = Boolean(sheet);
    // On a phone the panel lies below the picture, not over it.
    const room = `${Math.ceil(sheet?.getBoundingClientRect().height ?? 0)}px`, root = document.getElementById("root");
    if (root.style.marginBottom !== room) root.style.marginBottom = room;
    const touch = said("touch");
    document.getElementById("skin-now").textContent = touch === "–" ? status : touch;
    const end = document.getElementById("skin-end");
    const last = said("end");
    if (last && end.hidden) {
      end.hidden = false;
      end.firstElementChild.textContent = last;
    }
  }, 150);
})();
