/** The blocks of data in the page: JSON in elements that no browser runs, arrays of numbers in base64. */

/** What the block with this id holds, null where the page has none. */
export function readBlock(id) {
  const block = document.getElementById(id);
  return block ? JSON.parse(block.textContent) : null;
}

/** Little-endian numbers from base64, as every machine with WebGL stores them. */
export function decodeArray(base64, ArrayKind) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k += 1) bytes[k] = text.charCodeAt(k);
  return new ArrayKind(bytes.buffer);
}
