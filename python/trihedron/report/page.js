"use strict";
(() => {
  const UNITS = 10000, MINUS = "\u2212";
  const tip = document.createElement("div");
  tip.id = "tip"; tip.hidden = true; tip.setAttribute("aria-hidden", "true"); document.body.append(tip);
  const number = (v) => {
    if (v === 0) return "0";
    const size = Math.abs(v);
    const text = size >= 1e-4 && size < 1e6 ? String(+v.toPrecision(4)) : v.toExponential(3).replace("e+", "e");
    return text.replace(/-/g, MINUS);
  };
  function show(text, event) {
    tip.textContent = text; tip.hidden = false;
    const left = Math.min(event.pageX + 12, scrollX + document.documentElement.clientWidth - tip.offsetWidth - 4);
    tip.style.left = Math.max(0, left) + "px"; tip.style.top = (event.pageY + 16) + "px";
  }
  const hide = () => { tip.hidden = true; };

  /* Ticks of a zoomed panel: the same rule as in the file. */
  function ticks(low, high, most) {
    const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 2.5, 5, 10].map((m) => m * power).find((s) => s >= rough * (1 - 1e-9));
    const out = [], places = Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) + (step / power === 2.5 ? 1 : 0);
    for (let k = Math.ceil(low / step - 1e-9); k <= high / step + 1e-9; k++) out.push([k * step, (k * step).toFixed(Math.min(places, 12)).replace("-", MINUS)]);
    return out;
  }
  function logTicks(low, high) {
    if (Math.log10(high / low) < 1.2) return ticks(low, high, 4).filter(([v]) => v > 0);
    const out = [];
    for (let n = Math.floor(Math.log10(low)); n <= Math.ceil(Math.log10(high)); n++) for (const m of high / low < 100 ? [1, 2, 5] : [1]) {
      const v = m * 10 ** n;
      if (v >= low && v <= high) out.push([v, number(v)]);
    }
    return out;
  }

  class Panel {
    constructor(node) {
      this.node = node; this.plot = node.querySelector(".plot"); this.svg = node.querySelector("svg");
      const pair = (text) => text.split(" ").map(Number), d = node.dataset;
      this.log = { x: "xlog" in d, y: "ylog" in d };
      this.full = { x: this.scaled(pair(d.x), "x"), y: this.scaled(pair(d.y), "y") };
      this.now = { x: [...this.full.x], y: [...this.full.y] };
      this.unit = { x: d.ux || "", y: d.uy || "" };
      this.isTime = d.lx === "time [s]"; this.ready = null; this.tools(); this.listen();
    }
    scaled(pair, way) { return this.log[way] ? pair.map(Math.log10) : pair; }
    value(share, way) { const [a, b] = this.now[way], v = a + share * (b - a); return this.log[way] ? 10 ** v : v; }
    tools() {
      const box = document.createElement("div"); box.className = "tools";
      const named = [".ptitle", ".ylabel", ".xlabel"].map((part) => this.node.querySelector(part)?.textContent.trim());
      const about = named.filter(Boolean).join(", ");
      for (const [sign, words, act] of [["+", "Zoom in", () => this.zoom(0.5)], [MINUS, "Zoom out", () => this.zoom(2)], ["\u27f2", "Whole figure", () => this.reset()]]) {
        const b = document.createElement("button");
        b.type = "button"; b.textContent = sign; b.title = words; b.setAttribute("aria-label", words + ": " + about); b.onclick = act; box.append(b);
      }
      this.node.append(box);
    }
    zoom(factor, cx = 0.5, cy = null) {
      const around = (way, c) => { const [a, b] = this.now[way], at = a + c * (b - a); return [at - (at - a) * factor, at + (b - at) * factor]; };
      this.set(around("x", cx), cy === null ? this.now.y : around("y", cy));
    }
    reset() { this.set(this.full.x, this.full.y); }
    set(x, y, alone = false) {
      const clip = (pair, [a, b]) => [Math.max(pair[0], a), Math.min(pair[1], b)];
      this.now = { x: clip(x, this.full.x), y: clip(y, this.full.y) }; this.draw();
      const group = this.node.parentElement;
      if (!alone && "linked" in group.dataset) for (const other of all) if (other !== this && other.node.parentElement === group) other.set(this.now.x, other.now.y, true);
    }
    draw() {
      const part = (way) => { const [a, b] = this.full[way], [u, v] = this.now[way]; return [(u - a) / (b - a), (v - a) / (b - a)]; };
      const [x0, x1] = part("x"), [y0, y1] = part("y");
      this.svg.setAttribute("viewBox", [x0 * UNITS, (1 - y1) * UNITS, (x1 - x0) * UNITS, (y1 - y0) * UNITS].join(" "));
      let grid = "";
      for (const [way, most, name, edge] of [["x", 6, ".xticks", "left"], ["y", 5, ".yticks", "top"]]) {
        const [low, high] = [this.value(0, way), this.value(1, way)], [a, b] = this.full[way], [u, v] = this.now[way];
        const place = this.node.querySelector(name); place.replaceChildren();
        const said = this.node.dataset[way + "names"], names = said ? said.split("|") : null, sign = way === "x" ? 1 : -1;
        const places = names ? names.map((name, k) => [sign * (k + 1), name]).filter(([v]) => v >= low && v <= high) : null;
        for (const [at, word] of places || (this.log[way] ? logTicks(low, high) : ticks(low, high, most))) {
          const s = this.log[way] ? Math.log10(at) : at, whole = (s - a) / (b - a) * UNITS, here = (s - u) / (v - u);
          grid += way === "x" ? `M${whole} 0V${UNITS}` : `M0 ${UNITS - whole}H${UNITS}`;
          const span = document.createElement("span");
          span.textContent = word; span.style[edge] = 100 * (way === "x" ? here : 1 - here) + "%"; place.append(span);
        }
      }
      this.svg.querySelector(".grid").setAttribute("d", grid);
    }
    marks() {
      if (this.ready) return this.ready;
      const dots = [], lines = [];
      for (const p of this.svg.querySelectorAll("[data-t]")) {
        const n = p.getAttribute("d").match(/-?[\d.]+/g).map(Number), { a, z, t } = p.dataset, is = (name) => p.classList.contains(name);
        /* Dots of a path are three numbers each, bars five; the tooltip of all begins with a and ends with z. */
        t.split("|").forEach((one, k) => {
          const text = a + one + z, [x, y, v, w] = n.slice((is("area") ? 5 : 3) * k);
          /* A bar is pointed at anywhere along its length. */
          if (!is("area")) dots.push([x, y, text, 0, 0, p]);
          else dots.push([(x + w) / 2, 0, text, Math.abs(w - x) / 2, Infinity]);
        });
      }
      for (const p of this.svg.querySelectorAll("path[data-n]")) {
        const xs = [], ys = [], size = p.dataset.k || 1;
        for (const part of p.getAttribute("d").split("M").filter(Boolean)) {
          const n = part.match(/-?\d+/g).map(Number); let [x, y] = n; xs.push(x); ys.push(y);
          for (let k = 2; k + 1 < n.length; k += 2) { x += n[k]; y += n[k + 1]; xs.push(x); ys.push(y); }
        }
        lines.push([p.dataset.n, xs.map((x) => x * size), ys.map((y) => y * size)]);
      }
      return (this.ready = { dots, lines });
    }
    listen() {
      const plot = this.plot; let start = null, box = null;
      const at = (e) => { const r = plot.getBoundingClientRect(); return [(e.clientX - r.left) / r.width, (e.clientY - r.top) / r.height, r]; };
      plot.addEventListener("pointermove", (e) => {
        const [x, y, r] = at(e);
        if (start) {
          box.style.left = Math.min(x, start[0]) * r.width + "px"; box.style.top = Math.min(y, start[1]) * r.height + "px";
          box.style.width = Math.abs(x - start[0]) * r.width + "px"; box.style.height = Math.abs(y - start[1]) * r.height + "px";
          return;
        }
        this.hover(x, y, r, e);
      });
      plot.addEventListener("pointerleave", () => { hide(); this.mark(null); this.follow(null); });
      plot.addEventListener("pointerdown", (e) => {
        if (e.pointerType !== "mouse" || e.button) return;
        start = at(e); plot.setPointerCapture(e.pointerId); hide();
        box = document.createElement("div"); box.className = "pick"; plot.append(box);
      });
      plot.addEventListener("pointerup", (e) => {
        if (!start) return;
        const [x, y, r] = at(e), [u, v] = start; start = null; box.remove();
        if (Math.abs(x - u) * r.width < 8 && Math.abs(y - v) * r.height < 8) return;
        const cut = (way, p, q) => { const [a, b] = this.now[way]; return [a + Math.min(p, q) * (b - a), a + Math.max(p, q) * (b - a)]; };
        const flat = Math.abs(y - v) * r.height < 14;
        this.set(cut("x", x, u), flat ? this.now.y : cut("y", 1 - y, 1 - v));
      });
      plot.addEventListener("dblclick", () => this.reset());
      plot.addEventListener("wheel", (e) => {
        if (!e.ctrlKey && !e.metaKey) return;
        e.preventDefault(); const [x, y] = at(e); this.zoom(e.deltaY > 0 ? 1.25 : 0.8, x, 1 - y);
      }, { passive: false });
    }
    mark(dot) {
      if (this.marked) this.marked.remove();
      this.marked = null;
      if (!dot || !dot[5]) return;
      this.marked = dot[5].cloneNode(); delete this.marked.dataset.t;
      this.marked.classList.add("on"); this.marked.setAttribute("d", `M${dot[0]} ${dot[1]}h0`); dot[5].parentNode.append(this.marked);
    }
    /* One cursor over all axes of time. */
    follow(share) {
      if (!this.isTime) return;
      const time = share === null ? null : this.value(share, "x");
      for (const other of all) if (other.isTime) other.cursor(other === this ? null : time);
    }
    cursor(time) {
      this.line ??= this.plot.appendChild(Object.assign(document.createElement("div"), { className: "cursor" }));
      const [a, b] = this.now.x, at = (time - a) / (b - a);
      this.line.hidden = time === null || at < 0 || at > 1; this.line.style.left = 100 * at + "%";
    }
    hover(x, y, r, e) {
      this.follow(x);
      const { dots, lines } = this.marks(), view = this.svg.viewBox.baseVal;
      const ux = view.x + x * view.width, uy = view.y + y * view.height, sx = r.width / view.width, sy = r.height / view.height;
      let best = null, least = 26;
      for (const dot of dots) {
        const [px, py, , hx, hy] = dot, d = Math.hypot(Math.max(0, Math.abs(px - ux) - hx) * sx, Math.max(0, Math.abs(py - uy) - hy) * sy);
        if (d < least) { least = d; best = dot; }
      }
      this.mark(best);
      if (best) return show(best[2], e);
      const said = [];
      for (const [name, xs, ys] of lines) {
        let k = 0, near = Infinity;
        for (let i = 0; i < xs.length; i++) { const d = Math.abs(xs[i] - ux); if (d < near) { near = d; k = i; } }
        if (near * sx > 30) continue;
        const share = 1 - ys[k] / UNITS, [a, b] = this.full.y, v = a + share * (b - a);
        said.push(`${name}: ${number(this.log.y ? 10 ** v : v)} ${this.unit.y}`.trim());
      }
      if (!said.length) return hide();
      show([`${this.node.dataset.lx.replace(/ \[.*/, "")} ${number(this.value(x, "x"))} ${this.unit.x}`.trim(), ...said].join("\n"), e);
    }
  }
  const all = [...document.querySelectorAll(".panel")].map((node) => new Panel(node));

  /* Tables: a click on a head sorts by it, the third click brings back the order of the file. */
  const key = (text) => {
    const plain = text.replace(/\u2212/g, "-").replace(/[<>()]/g, " ").trim(), found = plain.match(/^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?/i);
    if (!found) return [1, plain];
    const power = plain.match(/\)?\s*e(-?\d+)$/i);
    return [0, Number(found[0]) * (power && !found[2] ? 10 ** Number(power[1]) : 1)];
  };
  for (const table of document.querySelectorAll("table")) {
    const body = table.tBodies[0], rows = [...body.rows];
    /* A row without a name belongs to the one above it. */
    if (rows.length < 4 || rows.some((row) => !row.cells[0].textContent.trim())) continue;
    [...table.tHead.rows[0].cells].forEach((head, k) => {
      if (!head.textContent.trim()) return;
      const button = document.createElement("button");
      button.type = "button"; button.textContent = head.dataset.name = head.textContent; button.title = "Sort"; head.replaceChildren(button);
      button.onclick = () => {
        const was = head.getAttribute("aria-sort");
        for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
        const now = was === "ascending" ? "descending" : was === "descending" ? null : "ascending";
        if (!now) return body.append(...rows);
        head.setAttribute("aria-sort", now);
        const sign = now === "ascending" ? 1 : -1;
        const sorted = rows.map((row) => [key(row.cells[k].textContent), row]).sort(([[s, a]], [[t, b]]) => s - t || sign * (a < b ? -1 : a > b ? 1 : 0));
        body.append(...sorted.map(([, row]) => row));
      };
    });
  }
  /* On paper nothing can be unfolded. */
  const folded = () => [...document.querySelectorAll("details:not([open])")];
  let opened = [];
  addEventListener("beforeprint", () => { opened = folded(); opened.forEach((d) => { d.open = true; }); });
  addEventListener("afterprint", () => opened.forEach((d) => { d.open = false; }));
})();
