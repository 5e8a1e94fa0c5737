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

  // A box beside a slider shows what the slider holds once it is at rest, whatever was typed.
  const follow = (box, slider, before, tries) => setTimeout(() => {
    const held = slider.getAttribute("aria-valuenow");
    if (held === before && (box.value === "" || Number(box.value) !== Number(held))) {
      Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set.call(box, held);
      box.dispatchEvent(new Event("input", { bubbles: true }));
    }
    if (tries && document.activeElement !== box) follow(box, slider, held, tries - 1);
  }, 100);
  addEventListener("focusout", (event) => {
    const box = event.target;
    const slider = box instanceof HTMLInputElement && box.closest(".mantine-NumberInput-root")
      ?.parentElement.querySelector('[role="slider"]');
    if (slider) follow(box, slider, null, 20);
  });

  const said = (name) => document.querySelector(`[data-name="${name}"]`)?.textContent.trim() ?? "";
  let folded = false;
  setInterval(() => {
    const status = said("status");
    if (!status) return;
    document.getElementById("skin-loading").hidden = true;
    const sheet = document.querySelector('.mantine-Paper-root[style*="position: fixed"]');
    if (!folded) sheet?.querySelector('div[style*="height: 3.5em"]')?.click();
    folded = Boolean(sheet);
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
