// The dashboard: history first, then live over the WebSocket. Everything shown comes from the service's own interface.
"use strict";

const WINDOW_S = 50, STEP_S = 25, WHOLE_WITHIN_S = 600, EVENTS_MAX = 100, POINTS_MAX = 60000, REFRESH_MS = 3000;
const token = new URLSearchParams(location.search).get("access_token");
const withToken = (path) => token ? path + (path.includes("?") ? "&" : "?") + "access_token=" + encodeURIComponent(token) : path;
const get = async (path) => {
  const answer = await fetch(withToken(path));
  if (!answer.ok) throw Object.assign(new Error(`${path}: ${answer.status}`), { status: answer.status });
  return answer.json();
};
const byId = (id) => document.getElementById(id);
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const ng = (value) => value === null || value === undefined ? "–" : value.toLocaleString("en", { minimumFractionDigits: 1, maximumFractionDigits: 1 });
const clockText = (s) => { const d = Math.floor(s / 86400), t = new Date((s - d * 86400) * 1000).toISOString().slice(11, 19); return `${d}/${t}`; };

let liftoffClockS = 0;         // met_s = clock_s - this
const windows = new Map();     // window_start_clock_s -> window
let gaps = [], playbacks = [], dirty = true;

// ---- traces -----------------------------------------------------------------------------------------------------
const AXES = [["x", "X tail to nose"], ["y", "Y to starboard"], ["z", "Z down"]];
const plots = AXES.map(([axis, name]) => makePlot(axis, name));

function makePlot(axis, name) {
  const colour = css("--" + axis), box = byId("plot-" + axis);
  const line = { stroke: "transparent", points: { show: false }, spanGaps: false };
  return new uPlot({
    width: box.clientWidth, height: 190, cursor: { sync: { key: "oare" } }, legend: { show: true, live: true },
    scales: { x: { time: false } },
    axes: [
      { stroke: css("--quiet"), grid: { stroke: css("--line"), width: 1 }, values: (_, ticks) => ticks.map((s) => (s / 3600).toFixed(2) + " h") },
      { stroke: css("--quiet"), grid: { stroke: css("--line"), width: 1 }, size: 70, label: "ng", labelSize: 18 },
    ],
    series: [
      { label: "MET", value: (_, s) => s === null ? "–" : clockText(s) },
      { label: name, stroke: colour, width: 1.4, spanGaps: false, points: { show: false }, value: (_, v) => ng(v) },
      { label: "−2σ", ...line, value: (_, v) => ng(v) }, { label: "+2σ", ...line, value: (_, v) => ng(v) },
      { label: "−σ", ...line, value: (_, v) => ng(v) }, { label: "+σ", ...line, value: (_, v) => ng(v) },
    ],
    bands: [{ series: [3, 2], fill: colour + "1c" }, { series: [5, 4], fill: colour + "38" }],
  }, [[], [], [], [], [], []], box);
}

function columns(axis) {
  const starts = [...windows.keys()].sort((a, b) => a - b);
  const data = [[], [], [], [], [], []];
  let before = null;
  for (const start of starts) {
    const window = windows.get(start);
    // A hole in the grid of windows is shown as one.
    if (before !== null && start - before > 1.5 * STEP_S) push(data, before - liftoffClockS + STEP_S, null, null);
    push(data, start - liftoffClockS + WINDOW_S / 2, window[`a${axis}_ng`], window[`sigma_a${axis}_ng`]);
    before = start;
  }
  return data;
}

function push(data, metS, value, sigma) {
  const known = value !== null && value !== undefined && sigma !== null && sigma !== undefined;
  const at = (k) => known ? value + k * sigma : null;
  [metS, known ? value : null, at(-2), at(2), at(-1), at(1)].forEach((cell, n) => data[n].push(cell));
}

function draw() {
  if (!dirty) return;
  dirty = false;
  plots.forEach((plot, n) => {
    const zoomed = plot.data[0].length && (plot.scales.x.min > plot.data[0][0] || plot.scales.x.max < plot.data[0].at(-1));
    plot.setData(columns(AXES[n][0]), !zoomed);
  });
  drawTimeline();
  drawNow();
}

// ---- the latest value ---------------------------------------------------------------------------------------------
function drawNothing() {
  for (const axis of ["x", "y", "z"]) {
    byId("a" + axis).textContent = byId("s" + axis).textContent = ng(null);
    byId("a" + axis).dataset.ng = "";
  }
  delete byId("now").dataset.revision;
  byId("when").textContent = "no calibrated window yet";
  byId("quality").textContent = "";
}

function drawNow() {
  const latest = latestWindow();
  if (!latest) return drawNothing();
  for (const axis of ["x", "y", "z"]) {
    const cell = byId("a" + axis), value = latest[`a${axis}_ng`];
    cell.textContent = ng(value);
    cell.dataset.ng = value;
    byId("s" + axis).textContent = ng(latest[`sigma_a${axis}_ng`]);
  }
  const start = latest.window_start_clock_s;
  byId("now").dataset.revision = latest.revision;
  byId("when").textContent = `MET ${clockText(latest.met_s)} · ${latest.utc.replace("T", " ").slice(0, 19)} UTC`;
  byId("quality").textContent = `clock ${start} s · quality ${latest.quality} · calibration ${latest.calibration} · revision ${latest.revision}`;
}

const valued = (window, quantity) => ["ax_ng", "ay_ng", "az_ng"][quantity]((name) => window[name] !== null);
const later = (a, b) => !a || b.window_start_clock_s >= a.window_start_clock_s ? b : a;

// As `/accel`: of the last window with all three axes, or, where it is ten minutes older than the last with any, of that.
function latestWindow() {
  let newest = null, whole = null;
  for (const window of windows.values()) {
    if (valued(window, "some")) newest = later(newest, window);
    if (valued(window, "every")) whole = later(whole, window);
  }
  const isNear = whole && newest.window_start_clock_s - whole.window_start_clock_s <= WHOLE_WITHIN_S;
  return isNear ? whole : newest;
}

function take(window) {
  windows.set(window.window_start_clock_s, window);
  if (windows.size > POINTS_MAX) windows.delete(windows.keys().next().value);
  liftoffClockS = window.window_start_clock_s - window.met_s;
  dirty = true;
}

// A window that there is no longer: its frames have lost their places to others.
function drop(gone) {
  windows.delete(gone.window_start_clock_s);
  dirty = true;
}

// ---- modes, gaps and dumps ------------------------------------------------------------------------------------------
function drawTimeline() {
  const canvas = byId("timeline"), width = canvas.clientWidth, height = 86, ratio = devicePixelRatio || 1;
  canvas.width = width * ratio; canvas.height = height * ratio;
  const ink = canvas.getContext("2d");
  ink.scale(ratio, ratio);
  ink.clearRect(0, 0, width, height);
  const starts = [...windows.keys()];
  if (!starts.length) return;
  const from = starts.reduce((a, b) => Math.min(a, b)), to = starts.reduce((a, b) => Math.max(a, b)) + WINDOW_S;
  const at = (clockS) => 40 + (clockS - from) / (to - from) * (width - 50);
  const bar = (a, b, y, h, colour) => { ink.fillStyle = colour; ink.fillRect(at(a), y, Math.max(1, at(b) - at(a)), h); };
  ink.font = "11px system-ui"; ink.fillStyle = css("--quiet");
  ink.fillText("mode", 2, 18); ink.fillText("dumps", 2, 50);
  bar(from, to, 6, 18, css("--gap"));
  for (const [start, window] of windows) if (window.mode) bar(start, start + STEP_S + 1, 6, 18, css("--" + window.mode));
  for (const gap of gaps) bar(gap.from_clock_s, gap.to_clock_s, 6, 18, css("--gap"));
  playbacks.filter((p) => p.from_clock_s !== null).forEach((p, n) =>
    bar(p.from_clock_s, p.to_clock_s, 34 + (n % 3) * 10, 7, css(p.direction === "reverse" ? "--reverse" : "--dump")));
  ink.fillStyle = css("--quiet");
  for (let n = 0; n <= 6; n++) {
    const clockS = from + (to - from) * n / 6, text = ((clockS - liftoffClockS) / 3600).toFixed(1) + " h";
    ink.fillText(text, Math.min(at(clockS), width - 40), 80);
  }
}

// ---- status, ledger, calibration, notices -----------------------------------------------------------------------------
const rows = (table, list) => {
  table.replaceChildren(...list.map(([cells, head]) => {
    const row = document.createElement("tr");
    row.append(...cells.map((cell) => Object.assign(document.createElement(head ? "th" : "td"), { textContent: cell })));
    return row;
  }));
};

async function refresh() {
  try {
    const [status, listed, gapList, calibration, events, anomalies] = await Promise.all([
      get("/status"), get("/playbacks"), get("/gaps"), get("/calibration").catch(() => null), get("/events"), get("/anomalies"),
    ]);
    showStatus(status);
    playbacks = listed.playbacks; gaps = gapList.gaps;
    showCalibration(calibration);
    showNotices(events, anomalies);
    dirty = true;
  } catch (error) {
    chip("phase", "no answer", "bad");
  }
}

function chip(id, text, kind) { const it = byId(id); it.textContent = text; it.className = "chip " + kind; }

function showStatus(status) {
  byId("mission").textContent = `${status.mission} · spacecraft 0x${status.spacecraft_id.toString(16)}`;
  chip("phase", status.trouble ? "stuck: " + status.trouble : status.phase, status.phase === "running" ? "good" : "bad");
  const n = (value) => value.toLocaleString("en"), ingest = status.ingest;
  const refused = Object.entries(ingest.frames_refused);
  const known = ingest.frames_new + ingest.frames_repeated + refused.reduce((sum, [, k]) => sum + k, 0);
  rows(byId("ledger"), [
    [["frames durable", n(ingest.frames_durable)]], [["new", n(ingest.frames_new)]], [["repeated", n(ingest.frames_repeated)]],
    ...refused.map(([reason, k]) => [["refused: " + reason, n(k)]]),
    [["sums close", known === ingest.frames_durable ? "yes" : "NO"]],
    ...Object.entries(ingest.packets).map(([name, k]) => [["packets " + name, n(k)]]),
    ...Object.entries(ingest.packets_refused).map(([reason, k]) => [["packets refused: " + reason, n(k)]]),
    [["seconds covered", n(ingest.seconds_covered)]], [["gaps", n(ingest.gaps)]], [["windows", n(status.accel.windows)]],
    [["dumps", n(ingest.playbacks)]],
  ]);
  byId("clock").textContent = ingest.latest_clock_s === null ? "" : `telemetry to clock ${n(ingest.latest_clock_s)} s`;
}

function showCalibration(calibration) {
  byId("calibration-version").textContent = calibration ? `version ${calibration.version}` : "none yet";
  if (!calibration) return rows(byId("calibration"), []);
  const list = [[["axis", "range", "bias", "scale factor"], true]];
  for (const [axis, ranges] of Object.entries(calibration.axes)) {
    for (const [range, at] of Object.entries(ranges)) {
      const bias = at.bias ? at.bias.form ?? at.bias.model ?? "fitted" : "none";
      const scale = at.scale ? `${at.scale.correction.toFixed(4)} ± ${at.scale.sigma.toFixed(4)} ${at.scale.provenance}` : "–";
      list.push([[axis.toUpperCase(), range, bias, scale]]);
    }
  }
  list.push([["known since", "", "", `clock ${calibration.known_since_clock_s} s`]]);
  rows(byId("calibration"), list);
}

function showNotices(events, anomalies) {
  // What is odd comes first, all of it; of the many events that are not, the last.
  const newestFirst = (a, b) => b.at - a.at;
  const all = [
    ...anomalies.map((a) => ({ at: a.from_clock_s, odd: true, text: a.sentence })).sort(newestFirst),
    ...events.map((e) => ({ at: e.clock_s, odd: false, text: `${e.event.replaceAll("_", " ")} ${e.text}` })).sort(newestFirst).slice(0, EVENTS_MAX),
  ];
  byId("notices").replaceChildren(...all.map((notice) => {
    const item = document.createElement("li");
    item.className = notice.odd ? "odd" : "";
    const time = Object.assign(document.createElement("time"), { textContent: clockText(notice.at - liftoffClockS) });
    item.append(time, notice.text);
    return item;
  }));
}

// ---- diagnosis ---------------------------------------------------------------------------------------------------------
const significant = (x) => Math.abs(x) >= 1e5 ? Math.round(x).toLocaleString("en") : Number(x.toPrecision(4)).toLocaleString("en", { maximumFractionDigits: 6 });
const spanText = (s) => s === null ? null : s < 7200 ? `${Math.round(s / 60)} min` : `${(s / 3600).toFixed(1)} h`;

async function refreshDiagnosis() {
  // What was said stands while nobody answers; a service that has none says so by 404.
  const answer = await get("/diagnosis").catch((error) => error.status === 404 ? null : undefined);
  if (answer === undefined) return;
  byId("diagnosis").hidden = !answer;
  if (!answer) return;
  const p = answer.progress, kinds = { consistent: "good", explained: "bad", ambiguous: "wait", unexplained: "bad" };
  const said = answer.verdict !== null;
  chip("verdict", said ? answer.verdict : p.state, said ? kinds[answer.verdict] : p.state === "refused" ? "wait" : "");
  byId("verdict").dataset.verdict = answer.verdict ?? "";
  byId("diagnosis-sentence").textContent = p ? p.sentence : "";
  const list = answer.effects.flatMap((e) => e.parameters.map((q, n) =>
    [[n ? "" : e.name, q.name.replaceAll("_", " "), `${significant(q.value)} ± ${significant(q.sigma)} ${q.unit === "1" ? "" : q.unit}`]]));
  if (answer.hypothesis) list.push([["hypothesis", answer.hypothesis.axis, answer.hypothesis.formula]]);
  rows(byId("diagnosis-effects"), list);
  if (!p) return;
  const parts = [`${p.windows_searched.toLocaleString("en")} of ${p.windows_seen.toLocaleString("en")} usable windows looked at`];
  if (p.last_clock_s !== null) parts.push(`as of MET ${clockText(p.last_clock_s - liftoffClockS)}`);
  const since = { onset: "after its onset", logged_start: "after its start in the log" }[p.counted_from] ?? "after the first data";
  const sinceName = p.name_counted_from_clock_s === p.counted_from_clock_s ? since : "after the last of it began";
  const atOnce = (came) => came ? " (of a playback that came at once)" : "";
  if (p.time_to_detect_s !== null) parts.push(`alarm ${spanText(p.time_to_detect_s)} ${since}${atOnce(p.alarm_came_at_once)}`);
  if (p.time_to_name_s !== null) parts.push(`named ${spanText(p.time_to_name_s)} ${sinceName}${atOnce(p.name_came_at_once)}`);
  if (p.windows_beyond) parts.push(`${p.windows_beyond.toLocaleString("en")} windows are beyond the simulation`);
  if (p.alarms_withdrawn) parts.push(`${p.alarms_withdrawn} alarm(s) withdrawn`);
  if (p.searches_failed) parts.push(`${p.searches_failed} search(es) failed`);
  if (p.state === "searching") parts.push("a search is under way");
  byId("diagnosis-progress").textContent = parts.join(" · ");
}

// ---- live -------------------------------------------------------------------------------------------------------------
let lastSeq = null;

// Of another service's windows nothing stays.
function forget() {
  windows.clear();
  dirty = true;
}

function live() {
  // All of history the first time; after a broken connection, what came since.
  const anew = lastSeq === null;
  const from = anew ? "-4294967296" : "seq:" + lastSeq;
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  const socket = new WebSocket(withToken(`${scheme}://${location.host}/accel/live?from=${from}&topics=window,calibration,diagnosis`));
  socket.onopen = () => { if (anew) forget(); chip("link", "live", "good"); };
  socket.onmessage = (frame) => {
    const message = JSON.parse(frame.data);
    lastSeq = message.seq;
    if (message.type === "window" || message.type === "supersede") take(message);
    if (message.type === "window_withdrawn") drop(message);
    if (message.type === "diagnosis") refreshDiagnosis();
    if (message.type === "lag") chip("link", `live, ${message.count} missed`, "wait");
  };
  let opened = false;
  socket.addEventListener("open", () => { opened = true; });
  // A service that never had our last message is another one: begin anew.
  socket.onclose = () => { if (!opened) lastSeq = null; chip("link", "connection lost", "bad"); setTimeout(live, 1500); };
}

addEventListener("resize", () => { plots.forEach((plot, n) => plot.setSize({ width: byId("plot-" + AXES[n][0]).clientWidth, height: 190 })); dirty = true; });
setInterval(draw, 250);
setInterval(refresh, REFRESH_MS);
setInterval(refreshDiagnosis, REFRESH_MS);
refresh();
refreshDiagnosis();
live();
