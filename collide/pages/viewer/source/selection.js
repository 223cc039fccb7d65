/**
 * What is selected: a pair or a body, and the state. Everything on the page follows it, and the page's link tells it:
 * `#pair=A|B`, `#body=NAME`, `#state=K`, joined by `&`.
 */

export class Selection {
  constructor() {
    this.pair = null; // a row with names a and b
    this.body = null; // a name
    this.state = 0;
    this._followers = [];
  }

  /** Calls `follower(selection, changed)` from now on; `changed` is a set of "pair", "body", "state". */
  follow(follower) {
    this._followers.push(follower);
  }

  selectPair(row, state = this.state) {
    this._change({ pair: row, body: null, state });
  }

  selectBody(name) {
    this._change({ pair: null, body: name, state: this.state });
  }

  selectState(state) {
    // numbers of a pair belong to one state: elsewhere they would be wrong
    const pair = state === this.state ? this.pair : null;
    this._change({ pair, body: this.body, state });
  }

  clear() {
    this._change({ pair: null, body: null, state: this.state });
  }

  /** The same pair as another report tells it (null: no more), without a move of the camera. */
  renew(pair) {
    this.pair = pair;
    for (const follower of this._followers) follower(this, new Set());
  }

  _change(next) {
    const changed = new Set(Object.keys(next).filter((key) => next[key] !== this[key]));
    Object.assign(this, next);
    for (const follower of this._followers) follower(this, changed);
  }

  /** The part of a link after `#` that opens this view. */
  link() {
    const parts = [];
    if (this.pair) parts.push(`pair=${encodeName(this.pair.a)}|${encodeName(this.pair.b)}`);
    if (this.body !== null) parts.push(`body=${encodeName(this.body)}`);
    if (this.state) parts.push(`state=${this.state}`);
    return parts.join("&");
  }
}

/** What a link asks for: `{pair: [a, b], body, state}`, null where it says nothing or cannot be read. */
export function readLink(text) {
  const wanted = { pair: null, body: null, state: null };
  for (const part of text.replace(/^#/, "").split("&")) {
    const [key, value] = [part.slice(0, part.indexOf("=")), part.slice(part.indexOf("=") + 1)];
    if (key === "pair") {
      // some programs that pass links on encode the bar between the names, too
      const separated = value.includes("|") ? value : value.replace(/%7C/i, "|");
      const names = separated.split("|").map(decodeName);
      if (names.length === 2 && !names.includes(null)) wanted.pair = names;
    }
    if (key === "body") wanted.body = decodeName(value);
    if (key === "state" && /^\d+$/.test(value)) wanted.state = Number(value);
  }
  return wanted;
}

/** A name as part of a link; a name with half a surrogate pair has no link of its own. */
function encodeName(name) {
  try {
    return encodeURIComponent(name);
  } catch {
    return encodeURIComponent(name.toWellFormed());
  }
}

function decodeName(text) {
  try {
    return decodeURIComponent(text);
  } catch {
    return null;
  }
}
