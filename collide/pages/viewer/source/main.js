/** The page of a report: reads the data, builds tables and scene, and lets both follow the selection. */
import { comparisonVerdict } from "./engine_tables.js";
import { listenToKeys } from "./key_commands.js";
import { columnLength } from "./lengths.js";
import { followLive, isLive, keepCamera, takeKeptCamera } from "./live_page.js";
import { readBlock } from "./page_data.js";
import { isBound } from "./pair_tables.js";
import { trajectoryVerdict } from "./path_tables.js";
import { PageTheme } from "./page_theme.js";
import { preparePrint } from "./print_view.js";
import { ReportModel } from "./report_model.js";
import { RowFilters } from "./row_filters.js";
import { SceneTools } from "./scene_tools.js";
import { SceneView } from "./scene_view.js";
import { SecondState } from "./second_state.js";
import { Selection, readLink } from "./selection.js";
import { StatesStrip } from "./states_strip.js";
import { TablesPanel } from "./tables_panel.js";
import { element, printable, refill, shorten } from "./text_nodes.js";
import { swatch } from "./verdicts.js";

const byId = (id) => document.getElementById(id);

/** Tables first: they are read while the scene, which takes longer, is made. */
function start() {
  const model = new ReportModel(readBlock("report"), readBlock("drawing"), readBlock("contacts"), readBlock("ours"));
  const selection = new Selection();
  showVerdict(model);
  const panel = new TablesPanel({ tables: byId("tables"), card: byId("card") }, model, selection);
  const filters = new RowFilters(byId("filters"), model, () => panel.applyFilters());
  panel.setFilters(filters);
  const strip = new StatesStrip(byId("states"), model, selection);
  byId("scene").hidden = !model.bodies.length;
  afterPaint(() => startScene({ model, selection, panel, filters, strip }));
}

function startScene(page) {
  const { model, selection, panel, filters, strip } = page;
  const view = makeScene(model, selection);
  const tools = view ? new SceneTools(sceneNodes(), view, model, selection) : null;
  const second = view ? new SecondState(byId("second"), model, selection, view) : null;
  strip.setSecond(second);
  const theme = new PageTheme(byId("theme"), () => { view?.setTheme(); second?.setTheme(); });
  selection.follow((now, changed) => {
    if (changed.has("state")) filters.setState(now.state);
    announce(now, model);
    writeLink(now);
  });
  connectKeys({ selection, panel, tools, strip, filters });
  preparePrint(byId("still"), view ? byId("canvas") : null, {
    setPrinting: (printing) => panel.setPrinting(printing),
    renderLight: () => { document.documentElement.dataset.theme = "light"; view.setTheme(); view.stage.render(); },
    restore: () => theme.set(theme.choice),
  });
  addEventListener("hashchange", () => openLink(model, selection));
  openLink(model, selection);
  startLive(page, view);
  announceMeasures(view, model, selection, second);
}

/** Once, after the browser has painted what stands; in a window that is not seen soon all the same. */
function afterPaint(action) {
  let done = false;
  const once = () => {
    if (!done) action();
    done = true;
  };
  requestAnimationFrame(() => setTimeout(once));
  setTimeout(once, 400);
}

/** A live page: camera, filters and ghosts stay, and so does the pair that is selected. */
function startLive(page, view) {
  const camera = isLive() ? takeKeptCamera() : null;
  if (camera) view?.takeCamera(camera);
  const nodes = { mark: byId("live-mark"), state: byId("live-state"), label: byId("live-label"), problem: byId("problem") };
  followLive(nodes, {
    bodies: (update) => takeBodies(update, page, view),
    tables: () => takeTables(page),
    reload: () => { if (view) keepCamera(view.camera); },
  });
}

function takeBodies({ poses, verdicts, report, contacts }, { model, selection }, view) {
  const moved = poses.filter(([row, pose]) => pose.some((value, k) => value !== model.bodies[row].X_WB[k]));
  for (const [row, pose] of moved) model.changeBody(row, { pose });
  for (const [row, verdict] of verdicts) model.changeBody(row, { verdict });
  if (contacts) model.setContacts(contacts);
  if (report) model.setReport(report);
  view?.moveBodies(moved.map(([row]) => row), selection.state);
}

function takeTables({ model, selection, panel, filters }) {
  showVerdict(model);
  panel.rebuild();
  filters.refresh();
  const { pair, state } = selection;
  // of a pair that is not listed any more the names stay: it may come back
  selection.renew(pair && (model.findPair(pair.a, pair.b, state) ?? { a: pair.a, b: pair.b }));
}

function sceneNodes() {
  return { canvas: byId("canvas"), labels: byId("labels"), axes: byId("axes"), tools: byId("tools"), section: byId("section"), hover: byId("hover") };
}

/** The scene, or null with a word where the browser cannot draw it: the tables say everything all the same. */
function makeScene(model, selection) {
  if (!model.bodies.length) return null;
  try {
    return new SceneView(sceneNodes(), model, selection);
  } catch (error) {
    refill(byId("scene"), element("p", { class: "no-scene" }, `The scene is not drawn: ${printable(error.message)}. The tables need no WebGL.`));
    return null;
  }
}

function showVerdict(model) {
  const { report } = model;
  const lines = [];
  if (model.kind === "compare") lines.push([comparisonVerdict(report), report.ours_wrong ? "colliding" : "free"]);
  else if (model.trajectory) lines.push([trajectoryVerdict(model.trajectory), model.trajectory.collides ? "colliding" : "free"]);
  if (report.verdict) {
    const { text, collides, shallow, touching } = report.verdict;
    lines.push([lines.length ? `at the start: ${text}` : text, collides ? "colliding" : shallow || touching ? "touching" : "free"]);
  }
  refill(byId("verdict"), ...lines.map(([text, worst]) => element("span", {}, swatch(worst), " ", printable(text))));
  const scene = model.reportAt(0).scene;
  byId("scene-name").textContent = scene ? shorten(printable(scene.name), 80) : "comparison of engines";
  byId("kind").textContent = { check: "collide check", compare: "collide compare", spheres: "collide spheres" }[model.kind] ?? (isLive() ? "collide view" : "collide report");
}

/** What is selected, over the scene and for screen readers. */
function announce(now, model) {
  const caption = byId("caption");
  if (now.pair) {
    const full = model.witnessed(now.pair, now.state);
    const { a, b, verdict, distance, depth } = full;
    const size = distance === undefined ? "" : depth ? `depth ${isBound(full) ? "≤ " : ""}${columnLength(depth)}` : `distance ${columnLength(distance)}`;
    const text = `${verdict ? `${verdict}, ` : ""}${size}`;
    refill(caption, verdict ? swatch(verdict) : null, ` ${shorten(printable(a), 40)} and ${shorten(printable(b), 40)}`, text ? `: ${text}` : "");
  } else if (now.body !== null) {
    refill(caption, `${shorten(printable(now.body), 60)}: ${model.verdictsAt(now.state)[model.rowOfBody(now.body)] ?? ""}`);
  } else refill(caption);
}

let written = "";

function writeLink(now) {
  written = now.link();
  const address = written ? `#${written}` : location.pathname + location.search;
  try {
    history.replaceState(null, "", address);
  } catch {
    location.hash = written; // a page from a folder may not change its address in some browsers
  }
}

function openLink(model, selection) {
  const text = location.hash.replace(/^#/, "");
  if (text === written) return;
  const wanted = readLink(text);
  const state = Math.min(wanted.state ?? 0, model.stateCount - 1);
  if (state !== selection.state) selection.selectState(state);
  if (wanted.pair) {
    const row = model.findPair(...wanted.pair, state);
    if (row) selection.selectPair(row, state);
    else announceMissing(`no row of this page is about ${wanted.pair.join(" and ")}`);
  } else if (wanted.body !== null) {
    if (model.rowOfBody(wanted.body) !== null) selection.selectBody(wanted.body);
    else announceMissing(`there is no body ${wanted.body}`);
  }
}

function announceMissing(text) {
  refill(byId("caption"), shorten(printable(text), 160));
}

function connectKeys({ selection, panel, tools, strip, filters }) {
  const run = (name) => () => tools?.run(name);
  const help = listenToKeys(byId("keys"), {
    j: () => panel.walk(1), k: () => panel.walk(-1), f: run("fit"), o: run("orthographic"), 1: run("front"), 2: run("side"),
    3: run("top"), 4: run("iso"), g: run("ghosts"), x: run("seeThrough"), w: run("wire"), c: run("section"),
    r: run("frames"), s: run("picture"),
    "[": () => strip.step(-1), "]": () => strip.step(1), p: () => { if (!byId("states").hidden) strip.toggle(); },
    h: () => strip.hold(),
    "/": () => filters.focusName(), Escape: () => selection.clear(),
  });
  byId("help").addEventListener("click", help);
}

/** Counts and camera for whoever measures the page, and a way to select by name. */
function announceMeasures(view, model, selection, second) {
  let pictures = 0;
  const opened = performance.now(); // since the page was asked for [ms]
  view?.stage.afterRender(() => { pictures += 1; });
  const measures = () => ({
    calls: view?.stage.renderer.info.render.calls ?? 0,
    triangles: view?.stage.renderer.info.render.triangles ?? 0,
    points: view?.stage.renderer.info.render.points ?? 0,
    camera: view?.stage.camera.position.toArray() ?? null,
    target: view?.stage.controls.target.toArray() ?? null,
    flying: view?.moves.isFlying ?? false,
    frames: view?.frames.count ?? 0,
    second: second?.state ?? null,
    state: selection.state,
    bodies: model.bodies.length,
    pictures,
    opened,
  });
  window.collideViewer = Object.freeze({
    measures,
    renderNow: () => view?.stage.render(),
    placeOf: (name) => view?.placeOf(name) ?? null,
    cornersOf: (name) => view?.cornersOf(name) ?? null,
    select: (name) => (name === null ? selection.clear() : selection.selectBody(name)),
  });
  document.documentElement.dataset.ready = "true";
}

start();
