"use strict";
// Draws what `mon3tr profile` measured. No library, no request: the figures are in the element #data.

const data = JSON.parse(document.getElementById("data").textContent);
const report = data.report, recorded = data.recorded, measured = report.measured;
const PERIOD_MS = 1000 / measured.display_hz;

// The paper's own figures (section "End-to-End Latency Evaluation"): 73.1 ms in all, about 21 of them for extracting parameters and
// about 22 for communication; what is left is the receiver's.
const PAPER = [["extracting motion", 21], ["network", 22], ["receiver", 30.1]];

const STAGE_COLOURS = ["#7b8794", "#3f7fd9", "#2aa3a3", "#3d9a57", "#d99a1e", "#8c6bd1", "#b457b8", "#d4588b", "#cf6a4d", "#c43f3f"];
const PART_COLOURS = ["#9aa5b1", "#6b7a8c", "#a9b665", "#7fb3c9", "#3f7fd9", "#3d9a57", "#e3c06a", "#d99a1e", "#c9a9dd", "#8c6bd1", "#c43f3f", "#d8a0a0"];

// ---- small helpers ----

const $ = (id) => document.getElementById(id);

function element(tag, attributes = {}, ...children) {
  const one = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) one.setAttribute(name, value);
  one.append(...children.filter((child) => child !== null && child !== undefined));
  return one;
}

function drawing(width, height, label) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.setAttribute("role", "img");
  svg.setAttribute("aria-label", label);
  svg.put = (tag, attributes, text) => {
    const one = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, value] of Object.entries(attributes)) one.setAttribute(name, value);
    if (text !== undefined) one.textContent = text;
    svg.append(one);
    return one;
  };
  return svg;
}

function ms(value) {
  const size = Math.abs(value);
  return value.toFixed(size >= 100 ? 0 : size >= 10 ? 1 : size >= 0.1 || size === 0 ? 2 : 3);
}
const percent = (share) => (share > 0 && share < 0.0005 ? "< 0.1 %" : `${(share * 100).toFixed(share > 0 && share < 0.0995 ? 1 : 0)} %`);
const megabytes = (bytes) => (bytes === null || bytes === undefined ? "unknown" : `${(bytes / 1e6).toFixed(0)} MB`);
const whole = (count) => Number(count).toLocaleString("en").replaceAll(",", "\u202f");
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const none = (why) => element("p", { class: "none" }, why);
const swatch = (colour) => element("i", { class: "swatch", style: `background:${colour}` });

/** Round steps so that about `count` of them fill `span`. */
function step(span, count) {
  const raw = span / count, power = 10 ** Math.floor(Math.log10(raw));
  return power * [1, 2, 5, 10].find((k) => k * power >= raw * 0.999);
}

function table(headings, rows, classes = []) {
  const head = element("tr", {}, ...headings.map((heading) => (heading instanceof Node ? heading : element("th", {}, heading))));
  const body = rows.map((cells, k) => element("tr", { class: classes[k] ?? "" }, ...cells.map((cell) =>
    cell instanceof Node && cell.tagName === "TD" ? cell : element("td", {}, cell))));
  return element("table", {}, element("thead", {}, head), element("tbody", {}, ...body));
}

function labelled(colour, text) {
  return element("td", {}, swatch(colour), text);
}

function pointed(event, text) {
  const tip = $("tip");
  tip.hidden = text === null;
  if (text === null) return;
  tip.textContent = text;
  const { width, height } = tip.getBoundingClientRect();
  tip.style.left = `${Math.min(event.clientX + 14, innerWidth - width - 8)}px`;
  tip.style.top = `${event.clientY + height + 24 > innerHeight ? event.clientY - height - 12 : event.clientY + 16}px`;
}

function hint(node, text) {
  node.addEventListener("mousemove", (event) => pointed(event, text));
  node.addEventListener("mouseleave", (event) => pointed(event, null));
}

// ---- head ----

function head() {
  const on = report.conditions, avatar = report.avatar;
  const name = avatar.name;
  document.title = `${name}: mon3tr profile`;
  $("subtitle").textContent = `${name}, ${measured.seconds.toFixed(1)} s ${report.sent ? "of a call " : ""}on this machine: ${on.motion} at ${measured.motion_hz.toFixed(0)} Hz, shown at ${measured.display_hz.toFixed(0)} Hz`;
  const size = `${on.width} × ${on.height} pixels`;
  const facts = [
    ["Avatar", `${whole(avatar.gaussians)} Gaussians, ${whole(avatar.vertices)} vertices, ${whole(avatar.controllers)} controllers`],
    ["Pictures", `${on.views === 2 ? `both eyes, 2 × ${size}` : size}; ${on.latency}d`],
    ["GPU", `${on.vulkan_device} (${on.vulkan_driver})`],
    ["Networks", on.provider ? `ONNX Runtime ${on.onnx_runtime.replace(/^ONNX Runtime /, "")} on ${on.provider}` : "compute shaders of the GPU"],
    ["CPU", `${on.cores} threads at once`],
    ["Package", `${avatar.package.split(/[\\/]/).pop()}, ${(avatar.package_bytes / 1e6).toFixed(1)} MB`],
  ];
  for (const [term, text] of facts) $("facts").append(element("dt", {}, term), element("dd", {}, text));
}

function tiles() {
  const tile = (value, unit, text, bad = false) => $("tiles").append(element("div", { class: bad ? "tile bad" : "tile" },
    element("b", {}, value, element("small", {}, ` ${unit}`)), element("span", {}, text)));
  const p = measured.pictures, latency = measured.latency;
  tile(p.per_second.toFixed(1), `of ${measured.display_hz.toFixed(0)} /s`, `pictures; ${whole(p.shown)} shown`, p.per_second < 0.95 * measured.display_hz);
  if (latency) tile(latency.whole.p50_ms.toFixed(0), "ms", `${latency.since} to display, median; 95\u00a0% within ${latency.whole.p95_ms.toFixed(0)}\u00a0ms`);
  else tile("–", "", "no picture was shown");
  tile(whole(p.missed_vblanks), "", `vertical blanks missed; ${whole(p.late)} pictures late, ${whole(p.repeated)} repeated`, p.missed_vblanks > 0.05 * p.shown);
  const at_once = measured.occupancy.at_once;
  tile(percent(at_once.slice(2).reduce((a, b) => a + b, 0)), "", `of the time two lanes or more work at once; ${percent(at_once[0])} none`);
  tile(megabytes(report.memory.host_peak_bytes).replace(/ MB$/, ""), report.memory.host_peak_bytes ? "MB" : "", `memory at most; ${megabytes(report.memory.device_bytes)} on the device`);
}

// ---- latency ----

function latency() {
  const at = $("latency"), of = measured.latency;
  if (!of) return at.append(none("No picture was shown, so there is no latency."));
  const parts = of.parts.map((one) => ({ ...one, colour: PART_COLOURS[recorded.parts.indexOf(one.part)] }));
  const WIDTH = 1160, LEFT = 108, BAR = 34;
  const most = Math.max(of.whole.mean_ms, of.whole.p95_ms, 100) * 1.06;
  const x = (value) => LEFT + (value / most) * (WIDTH - LEFT - 10);
  const svg = drawing(WIDTH, 150, "latency in parts, ours and the paper's");
  const every = step(most, 10);
  for (let tick = 0; tick <= most; tick += every) {
    svg.put("line", { x1: x(tick), x2: x(tick), y1: 12, y2: 126, class: "grid" });
    svg.put("text", { x: x(tick), y: 143, "text-anchor": "middle", class: "soft" }, tick === 0 ? "0 ms" : `${+tick.toFixed(3)}`);
  }
  const bar = (y, name, pieces, total) => {
    svg.put("text", { x: LEFT - 12, y: y + 15, "text-anchor": "end", "font-weight": 600 }, name);
    svg.put("text", { x: LEFT - 12, y: y + 30, "text-anchor": "end", class: "soft" }, total);
    let before = 0;
    for (const [label, value, colour, faded] of pieces) {
      const after = before + value, left = x(Math.min(before, after)), width = Math.abs(x(after) - x(before));
      const piece = svg.put("rect", { x: left, y, width: Math.max(width, 0.5), height: BAR, fill: colour, "fill-opacity": faded ? 0.4 : 1, stroke: "var(--card)", "stroke-width": width > 3 ? 1 : 0 });
      hint(piece, `${label}\n${ms(value)} ms`);
      const text = `${label} ${value >= 10 ? value.toFixed(0) : value.toFixed(1)}`;
      const fits = [text, label, value >= 10 ? value.toFixed(0) : value.toFixed(1)].find((one) => one.length * 6.8 + 8 < width);
      if (fits) svg.put("text", { x: left + width / 2, y: y + 21, "text-anchor": "middle", style: `fill:${faded ? "var(--ink)" : dark(colour) ? "#fff" : "#16191d"};pointer-events:none` }, fits);
      before = after;
    }
  };
  bar(18, "measured", parts.map((one) => [one.part, one.times?.mean_ms ?? one.mean_ms, one.colour, false]), `mean ${of.whole.mean_ms.toFixed(1)} ms`);
  bar(78, "the paper", PAPER.map(([label, value], k) => [label, value, ["#9aa5b1", "#6b7a8c", "#8c6bd1"][k], true]), "73.1 ms");
  const p95 = x(of.whole.p95_ms);
  svg.put("line", { x1: p95, x2: p95, y1: 14, y2: 56, class: "mark" });
  svg.put("text", { x: p95 > WIDTH - 90 ? p95 - 6 : p95 + 6, y: 66, class: "soft", "text-anchor": p95 > WIDTH - 90 ? "end" : "start" }, `95 % within ${of.whole.p95_ms.toFixed(0)} ms`);
  at.append(svg);
  at.append(element("p", { class: "note" }, `Measured: means of ${whole(of.whole.count)} pictures, from ${of.since === "capture" ? "capture" : "arrival (the capture times are unknown)"} to the vertical blank that shows the picture; means of parts add up, percentiles do not. ${of.left_out ? `${whole(of.left_out)} pictures that no frame brought are left out. ` : ""}The motion comes from a file: nothing is extracted from a camera. The paper: 73.1 ms on its own hardware, of which its text gives about 21 for extraction and about 22 for communication; the rest is the difference.`));
  let before = 0;
  const max = Math.max(of.whole.mean_ms, 1e-3);
  const rows = parts.map((one) => {
    const after = before + one.mean_ms;
    const [left, right] = [Math.min(before, after), Math.max(before, after)].map((value) => Math.max(0, Math.min(1, value / max)) * 100);
    const place = element("td", { style: "width:38%" }, element("i", { style: `display:block;height:10px;border-radius:2px;margin-left:${left}%;width:max(1px,${right - left}%);background:${one.colour}` }));
    before = after;
    return [labelled(one.colour, one.part), ms(one.mean_ms), ms(one.p50_ms), ms(one.p95_ms), ms(one.p99_ms), ms(one.max_ms), place];
  });
  const all = of.whole;
  rows.push([`${of.since} to display`, ms(all.mean_ms), ms(all.p50_ms), ms(all.p95_ms), ms(all.p99_ms), ms(all.max_ms), ""]);
  at.append(table(["part, ms", "mean", "p50", "p95", "p99", "max", element("th", { class: "left" }, "where in the mean")], rows, rows.map((_, k) => (k === rows.length - 1 ? "sum" : ""))));
}

function dark(colour) {
  const [r, g, b] = [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16));
  return 0.299 * r + 0.587 * g + 0.114 * b < 150;
}

// ---- timeline ----

function timeline() {
  const at = $("timeline"), spans = recorded.spans, count = spans.begin.length;
  if (count === 0) return at.append(none("No lane has recorded any work."));
  const states = recorded.states.map(([number, captured, arrived, released, inference, deformed, ready, source]) => ({ number, captured, arrived, released, inference, deformed, ready, source }));
  const stateOf = new Map(states.map((one) => [one.number, one]));
  const pictures = recorded.pictures.map(([number, from, to, alpha, displayed, repeated, late, gaussians, scale, parts, interpolatedFor]) => ({ number, from, to, alpha, displayed, repeated, late, gaussians, scale, parts, interpolatedFor }));
  const pictureOf = new Map(pictures.map((one) => [one.number, one]));
  const isPicture = recorded.stages.map(([, perPicture]) => perPicture);
  const usedBy = new Map();
  for (const one of pictures) for (const number of new Set([one.from, one.to])) usedBy.set(number, [...(usedBy.get(number) ?? []), one.number]);
  // Pictures drawn with the Gaussians that an interpolation made; none, where newer ones came before they were drawn.
  const madeBy = new Map();
  for (const one of pictures) madeBy.set(one.interpolatedFor, [...(madeBy.get(one.interpolatedFor) ?? []), one.number]);
  const INTERPOLATE = recorded.stages.findIndex(([name]) => name === "interpolate");
  const byFrame = new Map();
  for (let k = 0; k < count; k++) {
    const key = `${isPicture[spans.stage[k]] ? "p" : "m"}${spans.frame[k]}`;
    byFrame.set(key, [...(byFrame.get(key) ?? []), k]);
  }
  const first = spans.begin[0], last = recorded.end;
  const GUTTER = 96, AXIS = 24, ROW = 40, GAP = 8, NET = 30;
  const rows = [{ name: "network", height: NET }, ...recorded.lanes.map((name) => ({ name, height: ROW })), { name: "display", height: 26 }];
  let top = AXIS;
  for (const row of rows) { row.top = top; top += row.height + GAP; }
  const HEIGHT = top, OVERVIEW = 46;
  const frame = element("div", { class: "frame" }), canvas = element("canvas", {}), overview = element("canvas", { style: "margin-top:6px" });
  const buttons = element("div", { class: "buttons" });
  frame.append(buttons, canvas, overview);
  at.append(frame);
  const used = [...new Set(spans.stage)].sort((a, b) => a - b);
  at.append(element("div", { class: "legend" }, ...used.map((k) => element("span", {}, swatch(STAGE_COLOURS[k]), recorded.stages[k][0])),
    element("span", {}, swatch("#6b7a8c"), "on the network"), element("span", {}, swatch("#a9b665"), "in the jitter buffer"),
    ...[["--good", "shown in time"], ["--bad", "late"], ["--soft", "the same Gaussians again"]].map(([colour, text]) => element("span", {}, swatch(`var(${colour})`), text))));
  if (recorded.left_out[0] > 0) at.append(element("p", { class: "note" }, `The newest ${whole(count)} pieces of work are drawn; ${whole(recorded.left_out[0])} older ones are left out.`));

  const middle = (first + last) / 2, span = Math.min(last - first, 12 * recorded.period + 60000);
  let view = [middle - span / 2, middle + span / 2], way = null, width = 1000;
  const x = (us) => GUTTER + ((us - view[0]) / (view[1] - view[0])) * (width - GUTTER);
  const us = (px) => view[0] + ((px - GUTTER) / (width - GUTTER)) * (view[1] - view[0]);
  const laneRow = (k) => rows[1 + spans.lane[k]];
  const from = (time) => { // the first span that begins at or after `time`
    let low = 0, high = count;
    while (low < high) { const mid = (low + high) >> 1; if (spans.begin[mid] < time) low = mid + 1; else high = mid; }
    return low;
  };
  const longest = spans.takes.reduce((a, b) => Math.max(a, b), 0);

  function prepared(target, height) {
    width = target.clientWidth || 1000;
    const scale = devicePixelRatio || 1;
    target.style.height = `${height}px`;
    target.width = Math.round(width * scale);
    target.height = Math.round(height * scale);
    const context = target.getContext("2d");
    context.setTransform(scale, 0, 0, scale, 0, 0);
    context.clearRect(0, 0, width, height);
    context.font = "12px system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif";
    context.textBaseline = "middle";
    return context;
  }

  const netLane = (state) => ((state.number % 3) + 3) % 3;

  function draw() {
    const g = prepared(canvas, HEIGHT);
    const ink = css("--ink"), soft = css("--soft"), grid = css("--grid"), faint = css("--faint"), bad = css("--bad");
    for (const row of rows) { g.fillStyle = faint; g.fillRect(GUTTER, row.top, width - GUTTER, row.height); }
    g.save();
    g.beginPath(); g.rect(GUTTER, 0, width - GUTTER, HEIGHT); g.clip();
    const every = step(view[1] - view[0], width / 110);
    g.textAlign = "left";
    for (let tick = Math.ceil(view[0] / every) * every; tick < view[1]; tick += every) {
      g.strokeStyle = grid; g.beginPath(); g.moveTo(x(tick) + 0.5, 0); g.lineTo(x(tick) + 0.5, HEIGHT); g.stroke();
      g.fillStyle = soft; g.fillText(every >= 1e6 ? `${(tick / 1e6).toFixed(0)} s` : `${+(tick / 1e3).toFixed(3)} ms`, x(tick) + 4, 11);
    }
    const net = rows[0];
    for (const one of states) {
      const begun = one.captured ?? one.arrived;
      if (one.released < view[0] || begun > view[1]) continue;
      g.globalAlpha = way && !way.states.has(one.number) ? 0.32 : 1;
      const y = net.top + 2 + netLane(one) * 9;
      g.fillStyle = "#6b7a8c"; g.fillRect(x(begun), y, Math.max(x(one.arrived) - x(begun), 0.5), 7);
      g.fillStyle = "#a9b665"; g.fillRect(x(one.arrived), y, Math.max(x(one.released) - x(one.arrived), 0.5), 7);
    }
    for (let k = from(view[0] - longest); k < count && spans.begin[k] < view[1]; k++) {
      const left = x(spans.begin[k]), wide = x(spans.begin[k] + spans.takes[k]) - left;
      if (left + wide < GUTTER) continue;
      const row = laneRow(k), mine = way && way.spans.has(k);
      g.globalAlpha = way && !mine ? 0.32 : 1;
      g.fillStyle = STAGE_COLOURS[spans.stage[k]];
      g.fillRect(left, row.top + 3, Math.max(wide - (wide > 3 ? 0.7 : 0), 1), row.height - 6);
      const label = `${recorded.stages[spans.stage[k]][0].replace(/ \(.*/, "")}`;
      const shown = Math.min(left + wide, width) - Math.max(left, GUTTER);
      const text = [`${label} ${spans.frame[k]}`, label].find((one) => one.length * 6.6 + 8 < shown);
      if (text && (mine || !way)) {
        g.fillStyle = dark(STAGE_COLOURS[spans.stage[k]]) ? "#fff" : "#16191d"; g.textAlign = "center";
        g.fillText(text, Math.max(left, GUTTER) + shown / 2, row.top + row.height / 2 + 0.5);
      }
    }
    const display = rows[rows.length - 1];
    pictures.forEach((one, k) => {
      const until = pictures[k + 1]?.displayed ?? last;
      if (until < view[0] || one.displayed > view[1]) return;
      const left = x(one.displayed), wide = x(until) - left;
      g.globalAlpha = way && !way.pictures.has(one.number) ? 0.25 : 1;
      g.fillStyle = one.repeated ? css("--soft") : one.late ? bad : css("--good");
      g.fillRect(left + 1, display.top + 3, Math.max(wide - 2, 0.6), display.height - 6);
      const text = String(one.number);
      if (text.length * 7 + 8 < wide) { g.fillStyle = css("--card"); g.textAlign = "center"; g.fillText(text, left + wide / 2, display.top + display.height / 2 + 0.5); }
      g.globalAlpha = way ? 0.3 : 0.55;
      g.strokeStyle = one.late ? bad : soft; g.setLineDash([2, 3]); g.beginPath(); g.moveTo(left + 0.5, AXIS); g.lineTo(left + 0.5, HEIGHT - GAP); g.stroke(); g.setLineDash([]);
    });
    g.globalAlpha = 1;
    if (way) arrows(g, ink);
    g.restore();
    g.fillStyle = ink; g.textAlign = "right";
    for (const row of rows) g.fillText(row.name, GUTTER - 10, row.top + row.height / 2);
    drawOverview();
  }

  function arrows(g, ink) {
    g.strokeStyle = ink; g.lineWidth = 1.4;
    for (const [[ax, ay], [bx, by]] of way.arrows()) {
      const [a, b] = [x(ax), x(bx)], bend = Math.max(10, Math.abs(b - a) / 2);
      g.beginPath(); g.moveTo(a, ay); g.bezierCurveTo(a + bend, ay, b - bend, by, b, by); g.stroke();
      g.beginPath(); g.arc(b, by, 2.6, 0, 7); g.fillStyle = ink; g.fill();
    }
    g.lineWidth = 1;
  }

  function drawOverview() {
    const g = prepared(overview, OVERVIEW), cells = Math.max(1, Math.floor(width - GUTTER)), per = (last - first) / cells;
    const lanes = recorded.lanes.length, height = (OVERVIEW - 6) / lanes;
    const busy = recorded.lanes.map(() => new Float64Array(cells));
    for (let k = 0; k < count; k++) {
      const cell = Math.min(cells - 1, Math.floor((spans.begin[k] - first) / per));
      if (cell >= 0) busy[spans.lane[k]][cell] += spans.takes[k] / per;
    }
    busy.forEach((values, lane) => {
      for (let cell = 0; cell < cells; cell++) {
        const mean = (values[cell - 1] ?? 0) / 3 + values[cell] / 3 + (values[cell + 1] ?? 0) / 3;
        g.globalAlpha = 0.08 + 0.85 * Math.min(1, mean); g.fillStyle = css("--accent");
        g.fillRect(GUTTER + cell, 3 + lane * height, 1, height - 2);
      }
    });
    g.globalAlpha = 1;
    const place = (time) => GUTTER + ((time - first) / (last - first)) * (width - GUTTER);
    g.strokeStyle = css("--ink"); g.lineWidth = 1.5;
    g.strokeRect(place(view[0]), 1, Math.max(place(view[1]) - place(view[0]), 4), OVERVIEW - 2);
    g.fillStyle = css("--soft"); g.textAlign = "right"; g.fillText(`all ${((last - first) / 1e6).toFixed(1)} s`, GUTTER - 10, OVERVIEW / 2);
  }

  function show(begin, end) {
    const least = 200, most = last - first;
    let size = Math.min(Math.max(end - begin, Math.min(least, most)), most);
    begin = Math.min(Math.max(begin + (end - begin - size) / 2, first), last - size);
    view = [begin, begin + size];
    draw();
  }

  function zoom(factor, around) {
    show(around - (around - view[0]) * factor, around + (view[1] - around) * factor);
  }

  /** Everything that belongs to a motion frame or a picture. */
  function wayOf(stateNumbers, pictureNumbers) {
    const all = { states: new Set(stateNumbers), pictures: new Set(pictureNumbers), spans: new Set() };
    for (const number of stateNumbers) for (const k of byFrame.get(`m${number}`) ?? []) all.spans.add(k);
    // A picture's own work, after the interpolation that made its Gaussians, whichever picture that was for.
    const chainOf = (number) => {
      const made = byFrame.get(`p${pictureOf.get(number)?.interpolatedFor ?? number}`) ?? [];
      return [...made.filter((k) => spans.stage[k] === INTERPOLATE), ...(byFrame.get(`p${number}`) ?? []).filter((k) => spans.stage[k] !== INTERPOLATE)];
    };
    for (const number of pictureNumbers) for (const k of chainOf(number)) all.spans.add(k);
    const point = (k, end) => [end ? spans.begin[k] + spans.takes[k] : spans.begin[k], laneRow(k).top + laneRow(k).height / 2];
    all.arrows = () => {
      const result = [], ends = new Map();
      for (const number of all.states) {
        const chain = byFrame.get(`m${number}`) ?? [], state = stateOf.get(number);
        if (state && chain.length) result.push([[state.released, rows[0].top + 6 + netLane(state) * 9], point(chain[0], false)]);
        for (let k = 1; k < chain.length; k++) if (spans.lane[chain[k]] !== spans.lane[chain[k - 1]]) result.push([point(chain[k - 1], true), point(chain[k], false)]);
        if (chain.length) ends.set(number, point(chain[chain.length - 1], true));
      }
      for (const number of all.pictures) {
        const chain = chainOf(number), picture = pictureOf.get(number);
        for (const state of new Set([picture?.from, picture?.to])) if (chain.length && ends.has(state)) result.push([ends.get(state), point(chain[0], false)]);
        for (let k = 1; k < chain.length; k++) if (spans.lane[chain[k]] !== spans.lane[chain[k - 1]]) result.push([point(chain[k - 1], true), point(chain[k], false)]);
        const display = rows[rows.length - 1];
        if (picture && chain.length) result.push([point(chain[chain.length - 1], true), [picture.displayed, display.top + display.height / 2]]);
      }
      return result;
    };
    return all;
  }
  const wayOfState = (number) => wayOf([number], usedBy.get(number) ?? []);
  const wayOfPicture = (number) => { const one = pictureOf.get(number); return wayOf(one ? [one.from, one.to] : [], [number]); };

  function under(px, py) {
    const row = rows.find((one) => py >= one.top && py < one.top + one.height), time = us(px);
    if (!row || px < GUTTER) return null;
    if (row.name === "display") {
      const one = pictures.findLast((picture) => picture.displayed <= time);
      if (!one) return null;
      const total = one.parts.reduce((a, b) => a + b, 0) / 1000;
      return [wayOfPicture(one.number), `picture ${one.number}${one.repeated ? ", the same Gaussians again" : ""}${one.late ? ", late" : ""}\nshown at ${ms(one.displayed / 1000)} ms\nbetween states ${one.from} and ${one.to}, at ${one.alpha.toFixed(2)}\n${measured.latency?.since ?? "capture"} to display ${ms(total)} ms\n${whole(one.gaussians)} Gaussians, ${(one.scale * 100).toFixed(0)} % of the size`];
    }
    const index = rows.indexOf(row) - 1;
    if (index < 0) {
      const one = states.findLast((state) => netLane(state) === Math.min(2, Math.floor((py - row.top - 1) / 9)) && (state.captured ?? state.arrived) <= time && state.released >= time);
      return one ? [wayOfState(one.number), `motion frame ${one.number} (${one.source})\n${one.captured === null ? "capture unknown" : `${ms((one.arrived - one.captured) / 1000)} ms from capture to arrival`}\n${ms((one.released - one.arrived) / 1000)} ms in the jitter buffer`] : null;
    }
    const slack = ((view[1] - view[0]) / width) * 2;
    for (let k = from(time + slack) - 1; k >= 0 && spans.begin[k] > time - longest - slack; k--) {
      if (spans.lane[k] !== index || spans.begin[k] + spans.takes[k] + slack < time) continue;
      const [name, perPicture, unit] = recorded.stages[spans.stage[k]], number = spans.frame[k];
      const isMade = spans.stage[k] === INTERPOLATE, drawn = isMade ? madeBy.get(number) ?? [] : [number];
      const picture = perPicture ? pictureOf.get(drawn[0]) : null;
      if (isMade && !drawn.length) return [{ ...wayOf([], []), spans: new Set([k]) }, `${name}, ${unit}\nfor picture ${number}\n${ms(spans.takes[k] / 1000)} ms from ${ms(spans.begin[k] / 1000)} ms\nnever drawn: newer Gaussians came first`];
      const more = picture ? `\nbetween states ${picture.from} and ${picture.to}, at ${picture.alpha.toFixed(2)}\nshown at ${ms(picture.displayed / 1000)} ms` : perPicture ? "" : `\nused by ${(usedBy.get(number) ?? []).length} pictures`;
      const states = (of) => of.flatMap((one) => (pictureOf.has(one) ? [pictureOf.get(one).from, pictureOf.get(one).to] : []));
      return [perPicture ? wayOf(states(drawn), drawn) : wayOfState(number), `${name}, ${unit}\n${isMade ? "for picture" : perPicture ? "picture" : "motion frame"} ${number}${isMade && String(drawn) !== String(number) ? `, drawn in ${drawn.join(", ")}` : ""}\n${ms(spans.takes[k] / 1000)} ms from ${ms(spans.begin[k] / 1000)} ms${more}`];
    }
    return null;
  }

  let drag = null;
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoom(Math.exp(Math.max(-60, Math.min(60, event.deltaY)) * 0.004), us(event.offsetX)); }, { passive: false });
  canvas.addEventListener("pointerdown", (event) => { drag = [event.clientX, ...view]; canvas.setPointerCapture(event.pointerId); canvas.classList.add("moving"); });
  canvas.addEventListener("pointerup", () => { drag = null; canvas.classList.remove("moving"); });
  canvas.addEventListener("pointermove", (event) => {
    if (drag) { const by = ((drag[0] - event.clientX) / (width - GUTTER)) * (drag[2] - drag[1]); pointed(event, null); return show(drag[1] + by, drag[2] + by); }
    const found = under(event.offsetX, event.offsetY), had = way !== null;
    way = found?.[0] ?? null;
    pointed(event, found?.[1] ?? null);
    if (way || had) draw();
  });
  canvas.addEventListener("pointerleave", (event) => { way = null; pointed(event, null); draw(); });
  canvas.addEventListener("dblclick", () => show(first, last));
  const jump = (event) => { if (event.buttons & 1) { const half = (view[1] - view[0]) / 2, time = first + ((event.offsetX - GUTTER) / (overview.clientWidth - GUTTER)) * (last - first); show(time - half, time + half); } };
  overview.addEventListener("pointerdown", jump);
  overview.addEventListener("pointermove", jump);
  for (const [text, label, act] of [["+", "closer", () => zoom(0.5, (view[0] + view[1]) / 2)], ["−", "further", () => zoom(2, (view[0] + view[1]) / 2)], ["all", "everything", () => show(first, last)]]) {
    const button = element("button", { "aria-label": label, title: label }, text);
    button.addEventListener("click", act);
    buttons.append(button);
  }
  addEventListener("resize", draw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  // A link with #picture=N shows that picture's path at once.
  const asked = /^#picture=(\d+)$/.exec(location.hash), picture = asked && pictureOf.get(Number(asked[1]));
  if (picture) {
    way = wayOfPicture(picture.number);
    const begun = [picture.from, picture.to].map((number) => stateOf.get(number)).map((one) => one?.captured ?? one?.arrived ?? picture.displayed);
    const took = Math.max(picture.displayed - Math.min(...begun), span / 4);
    view = [picture.displayed - took * 1.1, picture.displayed + took * 0.25];
  }
  show(...view);
}

// ---- lanes ----

function lanes() {
  const of = measured.occupancy, at = $("lanes"), columns = element("div", { class: "columns" });
  const bars = (title, rows) => {
    const ROW = 26, svg = drawing(560, rows.length * ROW + 4, title);
    rows.forEach(([name, share], k) => {
      const y = k * ROW + 2;
      svg.put("text", { x: 118, y: y + 15, "text-anchor": "end" }, name);
      svg.put("rect", { x: 128, y: y + 2, width: 370, height: ROW - 9, rx: 3, fill: "var(--faint)" });
      svg.put("rect", { x: 128, y: y + 2, width: 370 * Math.min(1, share), height: ROW - 9, rx: 3, fill: "var(--accent)" });
      svg.put("text", { x: 508, y: y + 15 }, percent(share));
    });
    return element("div", {}, element("h3", {}, title), svg);
  };
  columns.append(
    bars("How much of the time each lane works", of.lanes.map((one) => [recorded.lanes[["motion", "npu", "cpu", "gpu"].indexOf(one.who)] ?? one.who, one.share])),
    bars("How much of the time so many lanes work at once", of.at_once.map((share, k) => [["none", "one", "two", "three", "four"][k], share])),
    bars("How much of the time each unit works", of.units.map((one) => [one.who, one.share])));
  const name = (lane) => recorded.lanes[["motion", "npu", "cpu", "gpu"].indexOf(lane)] ?? lane;
  const pairs = element("div", {}, element("h3", {}, "How much of the time two lanes both work"),
    table(["", ...of.lanes.slice(0, -1).map((one) => name(one.who))], of.lanes.slice(1).map((row) => [name(row.who), ...of.lanes.slice(0, -1).map((column) => {
      const pair = of.pairs.find((one) => one.lanes[0] === column.who && one.lanes[1] === row.who);
      return pair ? element("td", { style: `background:color-mix(in srgb, var(--accent) ${Math.round(pair.share * 70)}%, transparent)` }, percent(pair.share)) : "";
    })])));
  columns.append(pairs);
  at.append(columns);
}

// ---- stages ----

function stages() {
  const at = $("stages");
  if (measured.stages.length === 0) return at.append(none("No stage has run."));
  const indexOf = (name) => recorded.stages.findIndex(([stage]) => stage === name);
  // A stage done in slices takes as long as all of them together.
  const samples = new Map();
  for (let k = 0; k < recorded.spans.begin.length; k++) {
    const of = samples.get(recorded.spans.stage[k]) ?? new Map(), frame = recorded.spans.frame[k];
    of.set(frame, (of.get(frame) ?? 0) + recorded.spans.takes[k] / 1000);
    samples.set(recorded.spans.stage[k], of);
  }
  const WIDTH = 1160, LEFT = 170, RIGHT = 20, ROW = 36, height = measured.stages.length * ROW + 34;
  const values = [...samples.values()].flatMap((of) => [...of.values()]).filter((value) => value > 0);
  const low = Math.max(0.001, 10 ** Math.floor(Math.log10(values.reduce((a, b) => Math.min(a, b), PERIOD_MS)))), high = Math.max(values.reduce((a, b) => Math.max(a, b), 0), PERIOD_MS) * 1.15;
  const x = (value) => LEFT + (Math.log(Math.max(value, low) / low) / Math.log(high / low)) * (WIDTH - LEFT - RIGHT);
  const svg = drawing(WIDTH, height, "distribution of each stage's times");
  for (let decade = low; decade <= high * 1.0001; decade *= 10) for (const k of [1, 2, 5]) {
    const tick = decade * k;
    if (tick > high) continue;
    svg.put("line", { x1: x(tick), x2: x(tick), y1: 4, y2: height - 22, class: "grid" });
    svg.put("text", { x: x(tick), y: height - 6, "text-anchor": "middle", class: "soft" }, `${+tick.toPrecision(2)}${tick === low ? " ms" : ""}`);
  }
  svg.put("line", { x1: x(PERIOD_MS), x2: x(PERIOD_MS), y1: 4, y2: height - 22, class: "mark" });
  measured.stages.forEach((row, k) => {
    const index = indexOf(row.stage), colour = STAGE_COLOURS[index] ?? "#888888", base = (k + 1) * ROW;
    svg.put("text", { x: LEFT - 12, y: base - 10, "text-anchor": "end" }, row.stage);
    const bins = new Float64Array(150), of = [...(samples.get(index)?.values() ?? [])];
    const wide = (WIDTH - LEFT - RIGHT) / bins.length;
    for (const value of of) bins[Math.max(0, Math.min(bins.length - 1, Math.floor((x(value) - LEFT) / wide)))]++;
    const most = bins.reduce((a, b) => Math.max(a, b), 1);
    bins.forEach((count, bin) => { if (count > 0) svg.put("rect", { x: LEFT + bin * wide, y: base - (ROW - 8) * Math.sqrt(count / most), width: wide - 0.5, height: (ROW - 8) * Math.sqrt(count / most), fill: colour }); });
    svg.put("line", { x1: LEFT, x2: WIDTH - RIGHT, y1: base + 0.5, y2: base + 0.5, class: "grid" });
    for (const [value, label] of [[row.p50_ms, "median"], [row.p95_ms, "95th percentile"]]) {
      const mark = svg.put("path", { d: `M${x(value)} ${base - 1} l-4 6 l8 0 z`, fill: label === "median" ? "var(--ink)" : "var(--soft)" });
      hint(mark, `${row.stage}, ${label}\n${ms(value)} ms`);
    }
  });
  at.append(svg, element("p", { class: "note" }, `Each stage's times on a logarithmic axis; heights by the square root of the count. Triangles: the median, and fainter the 95th percentile; dashed: the display's period of ${PERIOD_MS.toFixed(1)} ms.`));
  at.append(table(["stage, ms", "unit", "count", "mean", "p50", "p95", "p99", "max", `of ${PERIOD_MS.toFixed(1)} ms`], measured.stages.map((row) => [
    labelled(STAGE_COLOURS[indexOf(row.stage)] ?? "#888888", row.stage), row.unit, whole(row.count), ms(row.mean_ms), ms(row.p50_ms), ms(row.p95_ms), ms(row.p99_ms), ms(row.max_ms), row.display_share === undefined ? "" : percent(row.display_share)])),
    element("p", { class: "note" }, "The last column: the median as a share of the display's period, for stages of motion scaled by how often they run."));
}

// ---- over time ----

function overTime() {
  const at = $("over-time"), pictures = recorded.pictures;
  if (pictures.length < 2) return at.append(none("Fewer than two pictures were shown."));
  const shown = pictures.map((one) => one[4] / 1e6), end = recorded.end / 1e6, begin = Math.max(0, shown[0] - 0.1);
  const chart = (title, unit, points, floor, mark, steps) => {
    const WIDTH = 1160, LEFT = 64, HEIGHT = 132, TOP = 22, BOTTOM = 32;
    const tallest = points.reduce((a, b) => Math.max(a, b[1]), mark ?? 0), most = Math.max(tallest * 1.1, 1e-3);
    const x = (time) => LEFT + ((time - begin) / (end - begin)) * (WIDTH - LEFT - 12), y = (value) => HEIGHT - BOTTOM - ((value - floor) / (most - floor)) * (HEIGHT - TOP - BOTTOM);
    const svg = drawing(WIDTH, HEIGHT, title);
    svg.put("text", { x: LEFT, y: 12, class: "soft" }, `${title}, ${unit}`);
    const every = step(most - floor, 3);
    for (let tick = Math.ceil(floor / every) * every; tick <= most; tick += every) {
      svg.put("line", { x1: LEFT, x2: WIDTH - 12, y1: y(tick), y2: y(tick), class: "grid" });
      svg.put("text", { x: LEFT - 8, y: y(tick) + 4, "text-anchor": "end", class: "soft" }, whole(+tick.toFixed(3)));
    }
    const each = step(end - begin, 10);
    for (let tick = Math.ceil(begin / each) * each; tick <= end; tick += each) svg.put("text", { x: x(tick), y: HEIGHT - 15, "text-anchor": "middle", class: "soft" }, `${+tick.toFixed(2)} s`);
    if (mark) svg.put("line", { x1: LEFT, x2: WIDTH - 12, y1: y(mark), y2: y(mark), class: "mark" });
    const path = points.map(([time, value], k) => `${k === 0 ? "M" : steps ? `H${x(time).toFixed(1)}V` : "L"}${k > 0 && steps ? "" : `${x(time).toFixed(1)} `}${y(value).toFixed(1)}`).join("");
    svg.put("path", { d: steps ? `${path}H${x(end)}` : path, fill: "none", stroke: "var(--accent)", "stroke-width": 1.6, "stroke-linejoin": "round" });
    at.append(svg);
  };
  chart(`${measured.latency?.since ?? "capture"} to display of each picture`, "ms", pictures.map((one, k) => [shown[k], one[9].reduce((a, b) => a + b, 0) / 1000]), 0);
  const rate = [];
  let oldest = 0;
  shown.forEach((time, k) => { while (time - shown[oldest] >= 1) oldest++; if (time - shown[0] >= 1) rate.push([time, k + 1 - oldest]); });
  if (rate.length > 1) chart("pictures in the second before (dashed: the display's)", "a second", rate, 0, measured.display_hz);
  const drawn = measured.pictures.quality;
  if (drawn.length > 1) {
    if (drawn.some((one) => one.scale !== drawn[0].scale)) chart("drawn part of the full width and height", "%", drawn.map((one) => [Math.max(begin, one.at_s), one.scale * 100]), 0, null, true);
    if (drawn.some((one) => one.gaussians !== drawn[0].gaussians)) chart("Gaussians drawn", "count", drawn.map((one) => [Math.max(begin, one.at_s), one.gaussians]), 0, null, true);
  } else if (drawn.length === 1) at.append(element("p", { class: "note" }, `The quality did not change: ${whole(drawn[0].gaussians)} Gaussians at ${(drawn[0].scale * 100).toFixed(0)} % of the full width and height all the time.`));
  const quality = report.quality;
  if (!quality || quality.change_count === 0) return;
  const qualityOf = (one) => `${(one.resolution_scale * 100).toFixed(0)} % of width and height, detail ${one.level}${one.sort_every > 1 ? `, a sort every ${one.sort_every} pictures` : ""}`;
  at.append(element("h3", {}, "Quality given up to hold the rate, since the call began"), table(["step", element("th", { class: "left" }, "drawn"), "Gaussians kept", "seconds", "pictures"], quality.steps.filter((one) => one.pictures > 0).map((one) => [
    String(one.quality.step), element("td", { class: "left" }, qualityOf(one.quality)), percent(one.kept_share), one.seconds.toFixed(1), whole(one.pictures)])));
  at.append(table(["at", element("th", { class: "left" }, "why"), "from step", "to step", "load then", "load expected"], quality.changes.map((one) => [
    `${one.at_seconds.toFixed(1)} s`, element("td", { class: "left" }, one.reason.why === "overload" ? "pictures took too long" : "there was time to spare"), String(one.from_step), String(one.to_step), percent(one.reason.load), percent(one.reason.predicted_load)])));
}

// ---- heat and clocks ----

const QUANTITIES = [["temperature", "temperatures"], ["cpu_clock", "CPU clocks"], ["gpu_clock", "GPU clock"], ["gpu_busy", "GPU busy"], ["headroom", "heat, of severe throttling's"], ["level", "levels"]];
const MOST_LINES = 8;

function machine() {
  const of = report.machine, at = $("machine");
  for (const [quantity, title] of QUANTITIES) {
    const all = of.series.filter((one) => one.quantity === quantity).sort((a, b) => b.most - a.most);
    if (all.length && of.at_s.length > 1) at.append(...curves(title, of.at_s, all.slice(0, MOST_LINES), all.length));
  }
  if (of.series.length) at.append(table(["", "least", "mean", "most"], of.series.map((one) => [one.name, ...[one.least, one.mean, one.most].map((value) => `${+value.toFixed(1)} ${one.unit}`)])));
  else at.append(none("This machine tells neither temperatures nor clocks."));
  if (of.absent.length) at.append(element("h3", {}, "Not told"), element("dl", { class: "two" }, ...of.absent.flatMap((one) => [element("dt", {}, one.what), element("dd", {}, one.why)])));
}

/** A chart of some series over time, with gaps where they have none. */
function curves(title, times, shown, count) {
  const WIDTH = 1160, LEFT = 64, HEIGHT = 150, TOP = 22, BOTTOM = 32, end = times[times.length - 1];
  const least = Math.min(...shown.map((one) => one.least)), most = Math.max(...shown.map((one) => one.most)), room = Math.max((most - least) * 0.1, most * 0.02, 0.5);
  const low = Math.max(0, least - room), high = most + room;
  const x = (time) => LEFT + ((time - times[0]) / Math.max(end - times[0], 1e-3)) * (WIDTH - LEFT - 12), y = (value) => HEIGHT - BOTTOM - ((value - low) / (high - low)) * (HEIGHT - TOP - BOTTOM);
  const svg = drawing(WIDTH, HEIGHT, title);
  svg.put("text", { x: LEFT, y: 12, class: "soft" }, [title, shown[0].unit].filter((text) => text).join(", "));
  const every = step(high - low, 3), each = step(Math.max(end - times[0], 1e-3), 10);
  for (let tick = Math.ceil(low / every) * every; tick <= high; tick += every) {
    svg.put("line", { x1: LEFT, x2: WIDTH - 12, y1: y(tick), y2: y(tick), class: "grid" });
    svg.put("text", { x: LEFT - 8, y: y(tick) + 4, "text-anchor": "end", class: "soft" }, whole(+tick.toFixed(3)));
  }
  for (let tick = Math.ceil(times[0] / each) * each; tick <= end; tick += each) svg.put("text", { x: x(tick), y: HEIGHT - 15, "text-anchor": "middle", class: "soft" }, `${+tick.toFixed(2)} s`);
  shown.forEach((one, k) => {
    let pen = "M";
    const path = one.values.map((value, at) => {
      if (value === null) { pen = "M"; return ""; }
      const to = `${pen}${x(times[at]).toFixed(1)} ${y(value).toFixed(1)}`;
      pen = "L";
      return to;
    }).join("");
    hint(svg.put("path", { d: path, fill: "none", stroke: STAGE_COLOURS[(k + 1) % STAGE_COLOURS.length], "stroke-width": 1.6 }), `${one.name}\n${+one.least.toFixed(1)} to ${+one.most.toFixed(1)} ${one.unit}`);
  });
  const legend = element("p", { class: "legend" }, ...shown.map((one, k) => element("span", {}, swatch(STAGE_COLOURS[(k + 1) % STAGE_COLOURS.length]), one.name)));
  if (count > shown.length) legend.append(element("span", {}, `and ${count - shown.length} more in the table`));
  return [svg, legend];
}

// ---- placement ----

function placement() {
  const of = report.placement, at = $("placement"), kind = typeof of.provider === "object" && of.provider ? Object.keys(of.provider)[0] : of.provider;
  const names = { qnn: "QNN", nnapi: "NNAPI", xnnpack: "XNNPACK", cpu: "CPU" };
  const isChosen = (one) => one.plan === of.plan && one.provider === kind;
  at.append(element("p", {}, element("b", {}, report.conditions.provider ? `${of.plan} on ${report.conditions.provider}` : of.plan), ` (asked for: ${of.requested}): ${of.reason}.`));
  const units = [...new Set(of.units.map(([, unit]) => unit))];
  at.append(element("dl", { class: "two" },
    ...units.flatMap((unit) => [element("dt", {}, unit), element("dd", {}, of.units.filter(([, on]) => on === unit).map(([stage]) => stage).join(", "))]),
    ...(of.landing ? [element("dt", {}, "Graph"), element("dd", {}, `${of.graph}; nodes: ${Object.entries(of.landing.nodes).map(([name, count]) => `${count} on ${name}`).join(", ") || "not told"}`)] : [])));
  const tried = of.alternatives.filter((one) => one.costs && one.predicted_ms !== null);
  const best = Math.min(...tried.map((one) => one.predicted_ms));
  const most = Math.max(...tried.map((one) => one.predicted_ms), 1e-3);
  if (tried.length) {
    at.append(element("h3", {}, "Tried at the start, ms"), table(["placement", "graph on", "inference", "bind", "interpolate", "draw", "a picture every", "against the fastest", element("th", { class: "left" }, "")], tried.map((one) => [
      one.plan, one.provider ? `${names[one.provider] ?? one.provider} (${one.unit})` : `its shaders (${one.unit})`, ms(one.costs.inference), ms(one.costs.bind), ms(one.costs.interpolate), ms(one.costs.draw), ms(one.predicted_ms), one.predicted_ms === best ? "–" : `+${percent(one.predicted_ms / best - 1)}`,
      element("td", { class: "left", style: "width:26%" }, element("i", { class: "bar", style: `width:${(one.predicted_ms / most) * 70}%` }), isChosen(one) ? "chosen" : "")]), tried.map((one) => (isChosen(one) ? "chosen" : ""))));
    at.append(element("p", { class: "note" }, "Stages measured one at a time; the prediction lets units work at once and adds up what shares one piece of silicon."));
  }
  // One line for each reason: all of a provider's placements often share it.
  const reasons = [...new Set(of.alternatives.map((one) => one.refused).filter((reason) => reason))];
  if (!reasons.length) return;
  const plansOf = (reason) => [...new Set(of.alternatives.map((one) => one.provider))].flatMap((provider) => {
    const all = of.alternatives.filter((one) => one.provider === provider), refused = all.filter((one) => one.refused === reason);
    if (!refused.length) return [];
    const plans = refused.map((one) => one.plan).join(", ");
    if (!provider) return [plans];
    return [refused.length === all.length ? names[provider] ?? provider : `${plans} on ${names[provider] ?? provider}`];
  }).join("; ");
  at.append(element("h3", {}, "Not to be had, or not asked for"), element("dl", { class: "two" }, ...reasons.flatMap((reason) => [element("dt", {}, plansOf(reason)), element("dd", {}, reason.replace(/\s+/g, " "))])));
}

function rest() {
  const m = report.memory, call = report.call, sent = report.sent;
  const columns = element("div", { class: "columns" });
  columns.append(element("div", {}, element("h3", {}, "Memory"), table(["", "MB"], [
    ["this process, at the end", m.host_bytes], ["this process, at most", m.host_peak_bytes], ["more than before placements were tried", m.onnx_runtime_bytes], ["the device's, taken by the renderer", m.device_bytes],
  ].map(([name, bytes]) => [name, bytes === null || bytes === undefined ? "unknown" : (bytes / 1e6).toFixed(1)]))));
  const rows = [], left = report.skipped;
  if (call) rows.push(["codec and channel", `${call.announced.codec}, ${call.announced.channel}`], ["frames taken, lost, late", `${whole(call.released)}, ${whole(call.lost)}, ${whole(call.late)}`], ["payload", `${call.payload_kbit_s.toFixed(1)} kbit/s`]);
  if (sent?.encoded > 0) rows.push(["encoding a frame, mean", `${(sent.encode_ns / sent.encoded / 1000).toFixed(1)} µs`]);
  if (left) rows.push(["left out by lanes, since newer had come", `${whole(left.poses)} poses, ${whole(left.inferences)} inferences, ${whole(left.requests)} requests, ${whole(left.interpolations)} interpolations`]);
  columns.append(element("div", {}, element("h3", {}, "Call"), rows.length ? table(["", ""], rows) : none("The call told nothing.")));
  $("rest").append(columns);
}

// A part that cannot be drawn must not hide the others.
const failed = [];
for (const part of [head, tiles, latency, timeline, lanes, stages, overTime, machine, placement, rest]) {
  try { part(); } catch (error) { failed.push(`${part.name}: ${error.message}`); }
}
if (failed.length) document.querySelector("main").prepend(element("p", { class: "none" }, `Some parts cannot be drawn: ${failed.join("; ")}`));
document.documentElement.dataset.drawn = failed.length ? failed.join("; ") : "all";
