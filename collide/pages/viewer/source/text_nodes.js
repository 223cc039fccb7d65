/**
 * Elements made of text: nothing that a scene says is ever parsed as markup.
 *
 * Names come from files. What no reader can see in them (controls, direction marks, halves of surrogate pairs) is
 * written out, as the terminal does, and every name is isolated so that its direction moves nothing around it.
 */

const SVG = "http://www.w3.org/2000/svg";
const UNPRINTABLE = /[\p{Cc}\p{Cf}\p{Cs}\p{Co}\p{Cn}\p{Zl}\p{Zp}]|(?! )\p{Zs}/gu;
const SHORT_ESCAPES = { "\n": "\\n", "\r": "\\r", "\t": "\\t" };

/** An element: attributes by name, functions as listeners (`onclick`), children as nodes or text. */
export function element(tag, attributes = {}, ...children) {
  return fill(document.createElement(tag), attributes, children);
}

/** The same of SVG. */
export function svgElement(tag, attributes = {}, ...children) {
  return fill(document.createElementNS(SVG, tag), attributes, children);
}

function fill(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (typeof value === "function") node.addEventListener(name.slice(2), value);
    else node.setAttribute(name, value === true ? "" : String(value));
  }
  node.append(...children.filter((child) => child !== null && child !== undefined));
  return node;
}

/** Takes away all children and puts these in their place. */
export function refill(node, ...children) {
  node.replaceChildren(...children.filter((child) => child !== null && child !== undefined));
}

/** The text with what cannot be seen written out: `\n`, `\x1b`, `\u202e`. */
export function printable(text) {
  return String(text).replace(UNPRINTABLE, (character) => {
    if (SHORT_ESCAPES[character]) return SHORT_ESCAPES[character];
    const code = character.codePointAt(0);
    if (code < 0x100) return `\\x${code.toString(16).padStart(2, "0")}`;
    return code < 0x10000 ? `\\u${code.toString(16).padStart(4, "0")}` : `\\U${code.toString(16).padStart(8, "0")}`;
  });
}

/** The text with its middle replaced by … where it has more characters than `length`. */
export function shorten(text, length) {
  const characters = text.length > length ? Array.from(text) : [];
  if (characters.length <= length) return text;
  const tail = Math.floor((length - 1) / 2);
  return `${characters.slice(0, length - 1 - tail).join("")}…${characters.slice(-tail).join("")}`;
}

/** A name, shortened in its middle; the title has what was left out. */
export function nameNode(name, length = 40) {
  const whole = printable(name);
  const text = shorten(whole, length);
  return element("bdi", { class: "name", title: text === whole ? null : shorten(whole, 500) }, text);
}

/** A name of any length in full, wrapped. */
export function wholeName(name) {
  return element("bdi", { class: "name whole" }, printable(name));
}
