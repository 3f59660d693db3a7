// What a reader can do with the plots over time or speed of a report. Without it, and in print, the page is whole.
// A line of a plot is its path as drawn; axes say what their edges are worth, so that values are read off the drawing.
"use strict";
const plots = [];

function points(d) {  // path text -> strokes of [x, y], apart where a line has a gap
  return d.split("M").slice(1).map(part => {
    const numbers = part.match(/-?[\d.]+(?:e-?\d+)?/g).map(Number);
    return Array.from({length: numbers.length / 2}, (_, i) => [numbers[2 * i], numbers[2 * i + 1]]);
  });
}

function panel(group) {  // axes with the box that they fill, what its edges are worth, and their lines
  const [x0, x1, y0, y1] = group.dataset.axes.split(" ").map(Number);
  const corners = points(group.querySelector("path").getAttribute("d"))[0];
  const xs = corners.map(c => c[0]), ys = corners.map(c => c[1]);
  const box = {left: Math.min(...xs), right: Math.max(...xs), top: Math.min(...ys), bottom: Math.max(...ys)};
  const lines = [...group.querySelectorAll("[data-line]")].map(line => {
    const path = line.querySelector("path");
    return {name: line.dataset.line, line, path, strokes: points(path.getAttribute("d")), shown: true};
  });
  const x = px => x0 + (px - box.left) / (box.right - box.left) * (x1 - x0);
  const y = py => y1 - (py - box.top) / (box.bottom - box.top) * (y1 - y0);
  const px = value => box.left + (value - x0) / (x1 - x0) * (box.right - box.left);
  const moves = [...group.querySelectorAll("[data-band] path")].map(path => (
    {path, strokes: points(path.getAttribute("d")), closed: "Z"}));
  return {group, box, lines, moves: [...lines, ...moves], x, y, px};
}

function valueAt(panel, line, time) {  // the drawn value at a time, null in a gap
  const at = panel.px(time);
  for (const stroke of line.strokes)
    for (let i = 1; i < stroke.length; i++) {
      const [a, b] = [stroke[i - 1], stroke[i]];
      if (a[0] <= at && at <= b[0])
        return panel.y(b[0] > a[0] ? a[1] + (b[1] - a[1]) * (at - a[0]) / (b[0] - a[0]) : a[1]);
    }
  return null;
}

function redraw(plot) {  // lines, bands and values of the ticks for the part of the axis that is seen
  const [from, to] = plot.seen;
  for (const panel of plot.panels) {
    const {left, right} = panel.box, a = panel.px(from), scale = (right - left) / (panel.px(to) - a);
    for (const {path, strokes, closed = ""} of panel.moves)
      path.setAttribute("d", strokes.map(stroke => "M" + stroke.map(([x, y]) =>
        `${(left + (x - a) * scale).toFixed(2)} ${y}`).join("L") + closed).join(""));
  }
  const digits = Math.max(0, 2 - Math.floor(Math.log10(to - from)));
  for (const tick of plot.ticks)
    tick.text.textContent = plot.zoomed() ? written(plot.timeAt(tick.at), digits) : tick.says;
}

function written(value, digits) {
  return value.toLocaleString("en", {minimumFractionDigits: digits, maximumFractionDigits: digits});
}

function linked(plot) {
  return plots.filter(other => other.session === plot.session && other.axis === plot.axis);
}

function zoom(plot, range) {  // all plots of a session show the same time
  for (const other of linked(plot)) {
    other.seen = range || other.whole;
    redraw(other);
    overSpeed(other);
  }
}

function drawn(tag, attributes, says = "") {  // an element of SVG
  const made = document.createElementNS(plots[0].svg.namespaceURI, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.textContent = says;
  return made;
}

function round(low, high) {  // about five round values between two
  const rough = (high - low) / 6, ten = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 2.5, 5, 10].map(times => times * ten).find(size => size >= rough);
  return Array.from({length: 9}, (_, i) => (Math.ceil(low / step) + i) * step).filter(value => value <= high);
}

function overSpeed(plot) {  // the lines of the first panel that are shown, over speed, where it was asked for
  plot.xy?.replaceChildren();
  if (!plot.xy?.isConnected) return;
  const [from, to] = plot.seen, times = Array.from({length: 500}, (_, i) => from + (i + 0.5) / 500 * (to - from));
  const most = Number(plot.speed.line.name.match(/of ([\d,.]+)/)[1].replaceAll(",", ""));
  const speeds = times.map(time => valueAt(plot.speed.panel, plot.speed.line, time));
  const series = plot.panels[0].lines.filter(line => line.shown).map(line => ({line, points: times
    .map((time, i) => [speeds[i] === null ? null : speeds[i] * most, valueAt(plot.panels[0], line, time)])
    .filter(([x, y]) => x !== null && y !== null)}));
  const all = series.flatMap(one => one.points);
  if (!all.length) return;
  const ends = axis => [Math.min(...all.map(point => point[axis])), Math.max(...all.map(point => point[axis]))];
  const [a0, a1] = ends(0);
  const [[x0, x1], [y0, y1]] = [[Math.min(a0, 0), a1], ends(1)].map(([a, b]) => b > a ? [a, b] : [a - 1, b + 1]);
  const px = x => 50 + (x - x0) / (x1 - x0) * 420, py = y => 205 - (y - y0) / (y1 - y0) * 190;
  const text = {fill: "var(--ink)", "font-size": 9}, rule = {stroke: "var(--soft)", "stroke-width": 0.25};
  for (const x of round(x0, x1))
    plot.xy.append(drawn("path", {d: `M${px(x)} 15V208`, ...rule}),
      drawn("text", {...text, x: px(x), y: 220, "text-anchor": "middle"}, x.toLocaleString("en")));
  for (const y of round(y0, y1))
    plot.xy.append(drawn("path", {d: `M47 ${py(y)}H470`, ...rule}),
      drawn("text", {...text, x: 44, y: py(y) + 3, "text-anchor": "end"}, Number(y.toPrecision(6))));
  plot.xy.append(drawn("text", {...text, x: 260, y: 233, "text-anchor": "middle"}, "speed [rpm]"),
    drawn("text", {...text, x: 50, y: 10}, "temperature [°C]; filled: measured, hollow: model"));
  for (const {line, points} of series) {
    const colour = getComputedStyle(line.path).stroke, model = !/measured|recorded|corrected/.test(line.name);
    for (const [x, y] of points)
      plot.xy.append(drawn("circle", {cx: px(x).toFixed(1), cy: py(y).toFixed(1), r: 1.1, stroke: colour, "stroke-width": 0.5,
        fill: model ? "none" : colour}));
  }
}

function csv(plot) {  // the corners of the lines that are seen, where these enter and leave, and no value where a gap begins
  const rows = [["line", plot.unit, "value"]], [from, to] = plot.seen;
  for (const panel of plot.panels)
    for (const line of panel.lines.filter(line => line.shown)) {
      const corners = line.strokes.flatMap((stroke, i) => [...i ? [[panel.x(line.strokes[i - 1].at(-1)[0]), null]] : [],
        ...stroke.map(([x, y]) => [panel.x(x), panel.y(y)])]);
      const ends = [from, to].map(time => [time, valueAt(panel, line, time)]).filter(([, value]) => value !== null);
      const seen = [...ends, ...corners.filter(([time]) => time > from && time < to)].sort((a, b) => a[0] - b[0]);
      rows.push(...seen.map(([time, value]) => [line.name, time.toPrecision(7), value?.toPrecision(5) ?? ""]));
    }
  return rows.map(row => row.map(cell => `"${cell.replaceAll('"', '""')}"`).join(",")).join("\n");
}

function button(text, pressed, act) {
  const made = document.createElement("button");
  made.type = "button";
  made.textContent = text;
  if (pressed !== null) made.setAttribute("aria-pressed", pressed);
  made.addEventListener("click", () => act(made));
  return made;
}

function controls(plot) {
  const bar = document.createElement("div");
  bar.className = "controls";
  for (const line of plot.panels.flatMap(panel => panel.lines))
    bar.append(button(line.name, true, made => {
      line.shown = !line.shown;
      line.line.style.display = line.shown ? "" : "none";
      made.setAttribute("aria-pressed", line.shown);
      overSpeed(plot);
    }));
  const panel = plot.panels.find(panel => panel.lines.some(line => line.name.startsWith("speed [of ")));
  if (panel && plot.panels[0].lines.some(line => line.name.endsWith("[°C]"))) {
    plot.speed = {panel, line: panel.lines.find(line => line.name.startsWith("speed [of "))};
    plot.xy = drawn("svg", {viewBox: "0 0 500 240", role: "img", "aria-label": "temperatures over speed"});
    bar.append(button("over speed", null, made => {
      if (plot.xy.isConnected) plot.xy.remove(); else bar.after(plot.xy);
      made.setAttribute("aria-expanded", plot.xy.isConnected);
      overSpeed(plot);
    }));
  }
  bar.append(button(plot.unit === "rpm" ? "all speeds" : "whole time", null, () => zoom(plot, null)));
  bar.append(button("CSV of what is seen", null, () => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([csv(plot)], {type: "text/csv"}));
    link.download = "seen.csv";
    link.click();
  }));
  plot.told = document.createElement("output");
  plot.svg.parentNode.after(plot.told, bar);
}

function cursor(plot, time, begun) {  // a line at one time in every panel of a session, and the values there; one where a brush began
  for (const other of linked(plot)) {
    const {left, right} = other.panels[0].box, [from, to] = other.seen;
    const marks = [time, begun].filter(at => at !== null).map(at => left + (at - from) / (to - from) * (right - left));
    other.mark.setAttribute("d", other.panels.flatMap(({box}) => marks.map(at => `M${at} ${box.top}V${box.bottom}`)).join(""));
    const told = other.panels.flatMap(panel => panel.lines.filter(line => line.shown).map(line => {
      const value = valueAt(panel, line, time);
      return value === null ? "" : `${line.name} ${value.toPrecision(4)}`;
    }));
    other.told.textContent = `${written(time, other.unit === "rpm" ? 0 : 3)} ${other.unit}: ${told.filter(Boolean).join(" · ")}`;
  }
}

function explore(svg, session) {
  const panels = [...svg.querySelectorAll("[data-axes]")].map(panel);
  if (!panels.length) return;
  const first = panels[0], {left, right} = first.box, whole = [first.x(left), first.x(right)];
  const texts = panels.flatMap(panel => [...panel.group.querySelectorAll("[data-tick] text")]);
  const axis = [...svg.querySelectorAll("text")].map(text => text.textContent).find(says => /^(time|speed) .*\]$/.test(says));
  const plot = {svg, session, axis, panels, whole, seen: whole, unit: axis.match(/\[(.*)\]/)[1]};
  plot.zoomed = () => plot.seen !== plot.whole;
  plot.timeAt = px => plot.seen[0] + (px - left) / (right - left) * (plot.seen[1] - plot.seen[0]);
  plot.ticks = texts.map(text => ({text, at: Number(text.getAttribute("x")), says: text.textContent}));
  plot.mark = document.createElementNS(svg.namespaceURI, "path");
  plot.mark.setAttribute("class", "mark");
  svg.append(plot.mark);
  plots.push(plot);
  controls(plot);
  const timeOf = event => {
    const place = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    return plot.timeAt(Math.min(Math.max(place.x, left), right));
  };
  let begun = null;
  svg.addEventListener("pointerdown", event => { begun = event.button ? null : timeOf(event); });
  svg.addEventListener("pointermove", event => {
    if (!event.buttons) begun = null;  // let go where the page is not told of it
    cursor(plot, timeOf(event), begun);
  });
  addEventListener("pointerup", event => {  // a brush that ends beside the picture goes to its edge
    const range = [begun, timeOf(event)].sort((a, b) => a - b);
    if (begun !== null && range[1] - range[0] > 0.01 * (plot.seen[1] - plot.seen[0])) zoom(plot, range);
    begun = null;
  });
}

function overTime(svg) {  // a slider for a picture that is drawn at one of many times
  const data = JSON.parse(svg.dataset.overTime), told = document.createElement("output"), slider = document.createElement("input");
  const drawnOf = (what, tag) => Object.fromEntries([...svg.querySelectorAll(`[data-${what}]`)].map(
    group => [group.dataset[what], group.querySelector(tag)]));
  const parts = drawnOf("part", "path"), flows = drawnOf("flow", "path"), names = drawnOf("says", "text");
  const draw = () => {
    const i = Number(slider.value);
    for (const [name, colours] of Object.entries(data.fill)) parts[name].style.fill = colours[i];
    for (const [name, texts] of Object.entries(data.says)) if (names[name]) names[name].textContent = texts[i];
    data.wide.forEach((widths, flow) => { flows[flow].style.strokeWidth = widths[i]; });
    told.textContent = data.times[i];
  };
  Object.assign(slider, {type: "range", className: "controls", min: 0, max: data.times.length - 1, value: data.at});
  slider.setAttribute("aria-label", "time of the picture");
  slider.addEventListener("input", draw);
  svg.parentNode.after(slider, told);
  draw();
}

let session = "";
for (const found of document.querySelectorAll("h2, h3, figure svg"))
  if (found.tagName !== "svg") session = found.dataset.session || found.textContent;
  else if (found.dataset.overTime) overTime(found);
  else explore(found, session);
