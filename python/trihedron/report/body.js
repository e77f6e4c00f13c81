"use strict";
/* A body on a canvas, with the sphere of directions about it: the guide's page and the pages of reports draw it. */
const Body = (() => {
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const apply = (m, v) => m.map((row) => dot(row, v));
  const unit = (v) => { const n = Math.hypot(...v) || 1; return v.map((x) => x / n); };
  const times = (a, b) => a.map((row) => [0, 1, 2].map((j) => row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j]));
  function about(axis, angle) {
    const [x, y, z] = axis, c = Math.cos(angle), s = Math.sin(angle), k = 1 - c;
    return [[c + x * x * k, x * y * k - z * s, x * z * k + y * s], [y * x * k + z * s, c + y * y * k, y * z * k - x * s],
      [z * x * k - y * s, z * y * k + x * s, c + z * z * k]];
  }
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

  /* The canvas at the size of its place, empty; centre, radius and pixels to a CSS pixel. */
  function begin(canvas, share) {
    const ratio = window.devicePixelRatio || 1, box = canvas.getBoundingClientRect();
    if (canvas.width !== Math.round(box.width * ratio)) { canvas.width = Math.round(box.width * ratio); }
    if (canvas.height !== Math.round(box.height * ratio)) { canvas.height = Math.round(box.height * ratio); }
    const w = canvas.width, h = canvas.height, pen = canvas.getContext("2d");
    pen.clearRect(0, 0, w, h);
    return { pen, ratio, r: share * Math.min(w, h), cx: w / 2, cy: h / 2 + 0.02 * h };
  }

  /* Rim and three great circles; `place` takes a direction of the body to [x, y, depth] on the canvas. */
  function globe({ pen, ratio, r, cx, cy }, place) {
    pen.lineWidth = 1.5 * ratio;
    pen.strokeStyle = colour("--line");
    pen.beginPath(); pen.arc(cx, cy, r, 0, 7); pen.stroke();
    for (const plane of [0, 1, 2]) {
      pen.beginPath();
      for (let i = 0; i <= 60; i++) {
        const a = i / 60 * 2 * Math.PI, v = [0, 0, 0];
        v[(plane + 1) % 3] = Math.cos(a); v[(plane + 2) % 3] = Math.sin(a);
        const p = place(v); i ? pen.lineTo(p[0], p[1]) : pen.moveTo(p[0], p[1]);
      }
      pen.globalAlpha = 0.6; pen.stroke(); pen.globalAlpha = 1;
    }
  }

  function board({ pen, ratio }, place) {
    const a = 0.5, b = 0.34, c = 0.06;
    const corner = (i) => [(i & 1 ? a : -a), (i & 2 ? b : -b), (i & 4 ? c : -c)];
    const faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    const shown = faces.map((f) => { const p = f.map((i) => place(corner(i))); return { p, z: p.reduce((s, q) => s + q[2], 0), top: f[0] === 4 }; })
      .sort((f, g) => f.z - g.z);
    for (const f of shown) {
      pen.beginPath(); f.p.forEach((q, i) => i ? pen.lineTo(q[0], q[1]) : pen.moveTo(q[0], q[1])); pen.closePath();
      pen.fillStyle = colour("--board"); pen.globalAlpha = f.top ? 1 : 0.75; pen.fill(); pen.globalAlpha = 1;
      pen.strokeStyle = colour("--paper"); pen.lineWidth = 1.5 * ratio; pen.stroke();
    }
    pen.font = `600 ${17 * ratio}px system-ui, sans-serif`; pen.textAlign = "center"; pen.textBaseline = "middle";
    [[0.78, 0, 0], [0, 0.62, 0], [0, 0, 0.5]].forEach((v, i) => {
      const from = place(v.map((x) => x * [0.64, 0.55, 0.12][i])), to = place(v), end = place(v.map((x) => x * 1.16));
      pen.strokeStyle = pen.fillStyle = colour("--ink"); pen.lineWidth = 2.5 * ratio;
      pen.beginPath(); pen.moveTo(from[0], from[1]); pen.lineTo(to[0], to[1]); pen.stroke();
      pen.fillText("XYZ"[i], end[0], end[1]);
    });
    pen.textBaseline = "alphabetic";
  }
  return { dot, cross, apply, unit, times, about, colour, begin, globe, board };
})();
