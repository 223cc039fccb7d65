/** Light and dark: as the system says, or as the reader does. */

const NEXT = { auto: "dark", dark: "light", light: "auto" };

export class PageTheme {
  /** changed : called after every change of colours. */
  constructor(button, changed) {
    this._button = button;
    this._changed = changed;
    this._choice = "auto";
    button.addEventListener("click", () => this.set(NEXT[this._choice]));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => changed());
    this.set("auto");
  }

  get choice() {
    return this._choice;
  }

  set(choice) {
    this._choice = choice;
    if (choice === "auto") delete document.documentElement.dataset.theme;
    else document.documentElement.dataset.theme = choice;
    this._button.textContent = `colours: ${choice}`;
    this._changed();
  }
}
