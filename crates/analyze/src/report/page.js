"use strict";
// Draws what the page's data describe. No library, no network. One plot is one <figure data-plot="K">.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  // Null is where a curve is interrupted, and would count as 0.
  for (const p of data.plots) for (const s of p.series) s.y = s.y.map(v => v === null ? NaN : v);
  const SVG = "http://www.w3.org/2000/svg";
  const pad = { left: 70, right: 12, top: 18, bottom: 38 };
  const paper = { w: 700, h: 230 }; // of a plot in print: three fit on a page
  const plots = [];
  let shared = null; // the time range that all time axes show, or null for all of it
  let printing = false;

  const el = (parent, name, attrs, text) => {
    const e = document.createElementNS(SVG, name);
    for (const k in attrs) e.setAttribute(k, attrs[k]);
    if (text !== undefined) e.textContent = text;
    parent.appendChild(e);
    return e;
  };
  // As many digits as tell values apart that are a step from one another.
  const short = (x, step) => {
    if (isNaN(x)) return "–";
    if (x === 0) return "0";
    const a = Math.abs(x), tell = step > 0 ? Math.ceil(Math.log10(a / step) - 1e-9) + 1 : 0;
    if (a >= 1e7 || a < 1e-3 || (a >= 1e5 && tell <= 3)) return x.toExponential(Math.min(12, Math.max(2, tell - 1))).replace(/\.?0+e/, "e").replace("e+", "e");
    return String(Number(x.toPrecision(Math.min(15, Math.max(4, tell)))));
  };
  const power = k => Math.abs(k) < 3 ? short(Math.pow(10, k)) : "10" + String(k).replace(/[-\d]/g, c => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(c)]);
  // Ticks at 1, 2 or 5 times a power of ten.
  const ticks = (lo, hi, n) => {
    const raw = (hi - lo) / n, p = Math.pow(10, Math.floor(Math.log10(raw)));
    const step = [1, 2, 5, 10].map(m => m * p).find(s => s >= raw * 0.999);
    const out = [];
    for (let k = Math.ceil(lo / step); k * step <= hi + step * 1e-9; k++) out.push(Number((k * step).toPrecision(12)));
    return out;
  };
  const decades = (lo, hi) => {
    const out = [], a = Math.ceil(lo), b = Math.floor(hi), every = Math.max(1, Math.ceil((b - a) / 6));
    for (let k = a; k <= b; k += every) out.push(k);
    return out;
  };
  const below = (x, v) => { // index of the last x[k] <= v
    let a = 0, b = x.length;
    while (a < b) { const m = (a + b) >> 1; if (x[m] <= v) a = m + 1; else b = m; }
    return a - 1;
  };
  const extent = (lists, f) => {
    let lo = Infinity, hi = -Infinity;
    for (const l of lists) for (const v of l) { const w = f(v); if (w < lo) lo = w; if (w > hi) hi = w; }
    return [lo, hi];
  };
  const shade = s => `var(--c${s.colour % data.colours})`;
  // A range that shows something: what rounding leaves of a constant is none.
  const wide = ([lo, hi]) => {
    const size = Math.max(Math.abs(lo), Math.abs(hi));
    if (hi - lo > 1e-9 * size) return [lo, hi];
    const c = isFinite(size) ? (lo + hi) / 2 : 0;
    return [c - 1, c + 1];
  };

  class Plot {
    constructor(figure, spec) {
      this.spec = spec;
      this.figure = figure;
      this.svg = figure.querySelector("svg");
      this.legend = figure.querySelector(".legend");
      this.canvas = figure.querySelector("canvas");
      this.full = spec.x_range || extent(spec.series.map(s => s.x), v => v);
      // A recording of one moment still has an axis; what lies in a plane keeps off its frame.
      this.full = wide(this.full);
      if (!spec.x_range) { const room = (this.full[1] - this.full[0]) * 0.05; this.full = [this.full[0] - room, this.full[1] + room]; }
      this.range = null;
      this.hidden = new Set();
      this.listen();
    }
    get x() { return (this.spec.time ? shared : this.range) || this.full; }
    // Nearer than a ten-thousandth of the whole there is nothing to see, and numbers run out.
    set x(r) { if (r && !(r[1] - r[0] > (this.full[1] - this.full[0]) * 1e-4)) return; if (this.spec.time) { shared = r; for (const p of plots) if (p.spec.time) p.draw(); } else { this.range = r; this.draw(); } }

    yRange(x0, x1) {
      if (this.spec.image) return this.spec.y_range;
      const log = this.spec.log_y, f = log ? v => (v > 0 ? Math.log10(v) : NaN) : v => v;
      let lo = Infinity, hi = -Infinity;
      this.spec.series.forEach((s, k) => {
        if (this.hidden.has(k)) return;
        for (let i = 0; i < s.x.length; i++) if (s.x[i] >= x0 && s.x[i] <= x1) { const v = f(s.y[i]); if (v < lo) lo = v; if (v > hi) hi = v; }
      });
      for (const [v] of this.spec.levels) { const w = f(v); if (w < lo) lo = w; if (w > hi) hi = w; }
      if (this.spec.band) { lo = Math.min(lo, f(this.spec.band[0])); hi = Math.max(hi, f(this.spec.band[1])); }
      [lo, hi] = wide([lo, hi]);
      const room = (hi - lo) * 0.05;
      return [lo - room, hi + room];
    }

    draw() {
      const spec = this.spec, svg = this.svg, w = printing ? paper.w : Math.max(240, this.figure.clientWidth), h = printing ? paper.h : Math.round(Math.min(300, Math.max(200, w * 0.45)));
      svg.replaceChildren();
      svg.setAttribute("viewBox", `0 0 ${w} ${h}`);
      svg.setAttribute("height", h);
      const [x0, x1] = this.x, [y0, y1] = this.yRange(x0, x1), log = spec.log_y;
      const left = pad.left, right = w - pad.right, top = pad.top, bottom = h - pad.bottom;
      const sx = v => left + (v - x0) / (x1 - x0) * (right - left);
      const sy = v => bottom - ((log ? Math.log10(v) : v) - y0) / (y1 - y0) * (bottom - top);
      Object.assign(this, { w, h, left, right, top, bottom, sx, sy });
      const clip = "clip" + plots.indexOf(this);
      el(el(svg, "clipPath", { id: clip }), "rect", { x: left, y: top, width: right - left, height: bottom - top });
      const inside = el(svg, "g", { "clip-path": `url(#${clip})` });
      if (spec.window) el(inside, "rect", { class: "window", x: sx(spec.window[0]), y: top, width: Math.max(0, sx(spec.window[1]) - sx(spec.window[0])), height: bottom - top });
      if (spec.band) el(inside, "rect", { class: "band", x: left, y: sy(spec.band[1]), width: right - left, height: Math.max(0, sy(spec.band[0]) - sy(spec.band[1])) });
      const across = ticks(x0, x1, Math.max(3, w / 110)), up = log ? decades(y0, y1) : ticks(y0, y1, 5);
      for (const t of across) {
        el(svg, "line", { class: "grid", x1: sx(t), x2: sx(t), y1: top, y2: bottom });
        el(svg, "text", { x: sx(t), y: bottom + 15, "text-anchor": "middle" }, short(t, across[1] - across[0]));
      }
      this.fine = (y1 - y0) / 1000; // what a hovered value is told to
      for (const t of up) {
        const y = log ? sy(Math.pow(10, t)) : sy(t);
        el(svg, "line", { class: "grid", x1: left, x2: right, y1: y, y2: y });
        el(svg, "text", { x: left - 6, y: y + 4, "text-anchor": "end" }, log ? power(t) : short(t, up[1] - up[0]));
      }
      if (spec.image) this.paint(); else svg.appendChild(inside);
      el(svg, "text", { x: (left + right) / 2, y: h - 5, "text-anchor": "middle" }, spec.x_label);
      el(svg, "text", { x: 0, y: 0, "text-anchor": "middle", transform: `translate(12 ${(top + bottom) / 2}) rotate(-90)` }, spec.y_label);
      spec.series.forEach((s, k) => { if (!this.hidden.has(k)) this.curve(inside, s, k, x0, x1); });
      // Over the curves, of which quick ones are a patch.
      for (const [v] of spec.levels) el(inside, "line", { class: "level", x1: left, x2: right, y1: sy(v), y2: sy(v) });
      let next = Infinity; // where a name may stand at the lowest: not on the one of the level below
      for (const [v, name] of [...spec.levels].sort((a, b) => a[0] - b[0])) {
        const y = Math.min(sy(v) - 4, next);
        next = y - 13;
        el(svg, "text", { class: "note", x: right - 4, y, "text-anchor": "end" }, name);
      }
      let free = -1e9, row = 0; // where the last name ends
      const marks = spec.marks.filter(([v]) => v >= x0 && v <= x1);
      for (const [v] of marks) el(inside, "line", { class: "mark", x1: sx(v), x2: sx(v), y1: top, y2: bottom });
      for (const [v, name] of marks) {
        // Names that would touch go one line down.
        const end = sx(v) + 7 * name.length > right;
        row = sx(v) - (end ? 7 * name.length : 0) < free ? (row + 1) % 4 : 0;
        free = Math.max(free, sx(v) + (end ? 0 : 7 * name.length));
        el(inside, "text", { class: "note", x: sx(v) + (end ? -3 : 3), y: top + 11 + 12 * row, "text-anchor": end ? "end" : "start" }, name);
      }
      el(svg, "path", { class: "axis", fill: "none", d: `M${left} ${top}V${bottom}H${right}` });
      this.cursor = el(svg, "line", { class: "cursor", y1: top, y2: bottom, visibility: "hidden" });
      this.zoom = el(svg, "rect", { class: "zoom", y: top, height: bottom - top, visibility: "hidden" });
      this.names(null);
    }

    curve(parent, s, k, x0, x1) {
      const colour = shade(s);
      if (this.spec.points) {
        let d = "";
        for (let i = 0; i < s.x.length; i++) d += `M${this.sx(s.x[i]).toFixed(1)} ${this.sy(s.y[i]).toFixed(1)}h0`;
        el(parent, "path", { class: "curve", d, "data-points": s.x.length, style: `stroke:${colour};stroke-width:3;stroke-linecap:round;opacity:.5` });
        return;
      }
      // Only what is in sight, and one sample beyond each end; a plane's curve has no order to search.
      const plane = this.spec.id === "portrait";
      const from = plane ? 0 : Math.max(0, below(s.x, x0)), to = plane ? s.x.length : Math.min(s.x.length, below(s.x, x1) + 2);
      let d = "", pen = "M";
      for (let i = from; i < to; i++) {
        const y = this.sy(s.y[i]);
        if (!isFinite(y)) { pen = "M"; continue; }
        d += `${pen}${this.sx(s.x[i]).toFixed(1)} ${y.toFixed(1)}`;
        // A sample between two gaps is a dot.
        if (pen === "M" && !isFinite(this.sy(s.y[i + 1]))) d += "h0";
        pen = "L";
      }
      const size = to - from === 1 ? "stroke-width:6;" : ""; // a sample alone is to be seen
      el(parent, "path", { class: "curve", d, style: `${size}stroke:${colour}`, "data-points": to - from, "data-name": s.name });
    }

    paint() { // the spectrogram, cell by cell, under the axes
      const spec = this.spec, c = document.createElement("canvas"), rows = spec.image[0].length, cols = spec.image.length;
      c.width = cols; c.height = rows;
      const ctx = c.getContext("2d"), pixels = ctx.createImageData(cols, rows);
      const [lo, hi] = spec.value_range;
      for (let i = 0; i < cols; i++) for (let j = 0; j < rows; j++) {
        const u = Math.min(1, Math.max(0, (spec.image[i][j] - lo) / (hi - lo))) * (data.map.length - 1);
        const a = Math.min(data.map.length - 2, Math.floor(u)), f = u - a, at = 4 * ((rows - 1 - j) * cols + i);
        for (let k = 0; k < 3; k++) pixels.data[at + k] = data.map[a][k] + f * (data.map[a + 1][k] - data.map[a][k]);
        pixels.data[at + 3] = spec.image[i][j] === null ? 0 : 255;
      }
      ctx.putImageData(pixels, 0, 0);
      const group = el(this.svg, "g", { "clip-path": `url(#clip${plots.indexOf(this)})` });
      const x = this.sx(spec.full[0]), w = this.sx(spec.full[1]) - x;
      el(group, "image", { href: c.toDataURL(), x, y: this.top, width: w, height: this.bottom - this.top, preserveAspectRatio: "none", "data-points": rows * cols });
    }

    names(at) { // the legend, with values where the pointer is
      if (!this.legend) return;
      this.legend.replaceChildren();
      if (this.spec.image) {
        const key = document.createElement("span"), bar = document.createElement("i"), [lo, hi] = this.spec.value_range;
        bar.className = "map";
        bar.style.background = `linear-gradient(90deg, ${data.map.map(c => `rgb(${c})`)})`;
        key.append(`${Math.round(lo)}`, bar, `${Math.round(hi)} ${this.spec.value_label}`);
        this.legend.append(key);
      }
      this.spec.series.forEach((s, k) => {
        const item = document.createElement("span"), swatch = document.createElement("i");
        swatch.style.background = shade(s);
        if (this.hidden.has(k)) item.style.opacity = 0.4;
        item.append(swatch, s.name);
        if (at !== null && !this.spec.points && this.spec.id !== "portrait") {
          const i = Math.max(0, below(s.x, at)), near = i + 1 < s.x.length && s.x[i + 1] - at < at - s.x[i] ? i + 1 : i;
          const v = document.createElement("span");
          v.className = "value";
          v.textContent = ` ${short(s.y[near], this.spec.log_y ? 0 : this.fine)}`;
          item.append(v);
        }
        if (this.spec.series.length > 1) {
          item.style.cursor = "pointer";
          item.title = "show or hide";
          item.onclick = () => { this.hidden.has(k) ? this.hidden.delete(k) : this.hidden.add(k); this.draw(); };
        }
        this.legend.append(item);
      });
      if (at !== null) {
        const where = document.createElement("span");
        where.className = "value";
        where.textContent = `at ${short(at, (this.x[1] - this.x[0]) / 1000)} ${this.spec.x_label.split(", ")[1] || ""}`;
        this.legend.append(where);
      }
    }

    point(v) { // shows a place on the abscissa
      const seen = v !== null && v >= this.x[0] && v <= this.x[1];
      this.cursor.setAttribute("visibility", seen ? "visible" : "hidden");
      if (seen) { this.cursor.setAttribute("x1", this.sx(v)); this.cursor.setAttribute("x2", this.sx(v)); }
      this.names(seen ? v : null);
    }

    listen() {
      const svg = this.svg;
      let start = null;
      const at = e => { const r = svg.getBoundingClientRect(), px = (e.clientX - r.left) * this.w / r.width; return this.x[0] + (px - this.left) / (this.right - this.left) * (this.x[1] - this.x[0]); };
      const all = v => { for (const p of plots) if (p === this || (this.spec.time && p.spec.time)) p.point(v); };
      svg.addEventListener("pointerdown", e => { start = at(e); svg.setPointerCapture(e.pointerId); });
      svg.addEventListener("pointermove", e => {
        const v = at(e);
        all(v);
        if (start === null) return;
        const a = this.sx(Math.min(start, v)), b = this.sx(Math.max(start, v));
        this.zoom.setAttribute("visibility", b - a > 6 ? "visible" : "hidden");
        this.zoom.setAttribute("x", a);
        this.zoom.setAttribute("width", b - a);
      });
      svg.addEventListener("pointerup", e => {
        const v = at(e), from = start;
        start = null;
        this.zoom.setAttribute("visibility", "hidden");
        if (from === null || Math.abs(this.sx(v) - this.sx(from)) <= 6) return;
        this.x = [Math.max(this.full[0], Math.min(from, v)), Math.min(this.full[1], Math.max(from, v))];
      });
      svg.addEventListener("pointercancel", () => { start = null; this.zoom.setAttribute("visibility", "hidden"); });
      svg.addEventListener("pointerleave", () => all(null));
      svg.addEventListener("dblclick", () => { this.x = null; });
      svg.addEventListener("wheel", e => {
        if (!e.ctrlKey && !e.shiftKey) return; // plain scrolling moves the page
        e.preventDefault();
        const v = at(e), f = Math.pow(1.2, Math.sign(e.deltaY)), [a, b] = this.x;
        const r = [Math.max(this.full[0], v - (v - a) * f), Math.min(this.full[1], v + (b - v) * f)];
        this.x = r[0] <= this.full[0] && r[1] >= this.full[1] ? null : r;
      }, { passive: false });
      svg.addEventListener("keydown", e => {
        const [a, b] = this.x, m = (a + b) / 2, d = b - a;
        const to = { "+": [m - d / 4, m + d / 4], "-": [m - d, m + d], ArrowLeft: [a - d / 4, b - d / 4], ArrowRight: [a + d / 4, b + d / 4], Escape: this.full }[e.key];
        if (!to) return;
        e.preventDefault();
        const r = [Math.max(this.full[0], to[0]), Math.min(this.full[1], to[1])];
        this.x = r;
      });
    }
  }

  const time = data.plots.filter(p => p.time).map(p => p.image ? p.full : extent(p.series.map(s => s.x), v => v));
  const whole = [Math.min(...time.map(t => t[0])), Math.max(...time.map(t => t[1]))];
  document.querySelectorAll("figure[data-plot]").forEach(figure => {
    const spec = data.plots[Number(figure.dataset.plot)];
    if (spec.time) spec.x_range = whole;
    plots.push(new Plot(figure, spec));
  });
  const redraw = () => plots.forEach(p => p.draw());
  redraw();
  let width = document.body.clientWidth;
  new ResizeObserver(() => { if (document.body.clientWidth !== width) { width = document.body.clientWidth; redraw(); } }).observe(document.body);
  // Paper has a width of its own, and nobody opens on it what is closed.
  const closed = () => document.querySelectorAll(".metrics details:not([open])");
  let opened = [];
  window.addEventListener("beforeprint", () => { printing = true; redraw(); opened = [...closed()]; opened.forEach(d => { d.open = true; }); });
  window.addEventListener("afterprint", () => { printing = false; redraw(); opened.forEach(d => { d.open = false; }); });
  const reset = document.getElementById("reset");
  if (reset) reset.onclick = () => { shared = null; plots.forEach(p => { p.range = null; p.hidden.clear(); }); redraw(); };
  document.body.dataset.ready = "yes";
})();
