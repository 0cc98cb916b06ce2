// The colours of the curves, read from the style sheet: one place for both themes.

const NAMES = ["text", "muted", "line", "panel", "output", "force", "response", "accent", "warn", "bad", "earlier", "hatch"];
const THEMES = ["dark", "light", "system"];
const KEPT = "vibrolock-theme";

/** Colours by name, those of the present theme. */
export const ink = {};

export const FONT = "11px 'DIN Alternate', Bahnschrift, 'Roboto Condensed', 'Noto Sans', system-ui, sans-serif";

function read() {
  const style = getComputedStyle(document.documentElement);
  for (const name of NAMES) ink[name] = style.getPropertyValue(`--${name}`).trim();
}

/** Let the button change the theme; `changed` is called whenever the colours are others. */
export function themes(button, changed) {
  const light = matchMedia("(prefers-color-scheme: light)");
  let chosen = "dark";
  try {
    chosen = THEMES.includes(localStorage.getItem(KEPT)) ? localStorage.getItem(KEPT) : chosen;
  } catch {} // a browser may refuse to keep anything
  const apply = () => {
    document.documentElement.dataset.theme = chosen === "system" ? (light.matches ? "light" : "dark") : chosen;
    button.textContent = chosen;
    read();
    changed();
  };
  button.addEventListener("click", () => {
    chosen = THEMES[(THEMES.indexOf(chosen) + 1) % THEMES.length];
    try {
      localStorage.setItem(KEPT, chosen);
    } catch {}
    apply();
  });
  light.addEventListener("change", apply);
  apply();
}

/** A colour with less cover, for areas. */
export const faint = (colour, part) => `color-mix(in srgb, ${colour} ${Math.round(100 * part)}%, transparent)`;
