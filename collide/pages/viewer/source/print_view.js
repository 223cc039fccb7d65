/** For printers: all rows of the tables, and a still of the scene on white. */

/** hooks : `setPrinting(printing)` of the tables, `renderLight()` that draws the scene for paper, `restore()`. */
export function preparePrint(still, canvas, hooks) {
  addEventListener("beforeprint", () => {
    hooks.setPrinting(true);
    if (!canvas) return;
    hooks.renderLight();
    // the picture is copied at once: the card may forget it as soon as this function ends
    still.width = canvas.width;
    still.height = canvas.height;
    still.getContext("2d").drawImage(canvas, 0, 0);
  });
  addEventListener("afterprint", () => {
    hooks.setPrinting(false);
    if (canvas) hooks.restore();
  });
}
