// Curves over one axis as SVG: drag to zoom, double click to see everything, rest the mouse to read values.
"use strict";
(function () {
  const NS = "http://www.w3.org/2000/svg";
  const M = {left: 74, right: 16, top: 14, bottom: 42};

  function el(parent, tag, attributes, text) {
    const node = document.createElementNS(NS, tag);
    for (const name in attributes) node.setAttribute(name, attributes[name]);
    if (text !== undefined) node.textContent = text;
    parent.appendChild(node);
    return node;
  }

  function ticks(low, high, count) {
    const rough = (high - low) / count, power = Math.pow(10, Math.floor(Math.log10(rough)));
    const step = [1, 2, 5, 10].map(f => f * power).find(s => s >= rough);
    const found = [];
    for (let k = Math.ceil(low / step - 1e-9); k <= high / step + 1e-9; k++) found.push(k * step);
    return {values: found, step: step};
  }

  function label(value, step) {
    const size = Math.max(Math.abs(value), step);
    if (size >= 1e5 || step < 1e-4) return value === 0 ? "0" : value.toExponential(Math.max(0, Math.ceil(Math.log10(size / step) - 1e-9)));
    return value.toFixed(Math.max(0, -Math.floor(Math.log10(step) + 1e-9)));
  }

  function extent(lists) {
    let low = Infinity, high = -Infinity;
    for (const list of lists) for (const v of list) if (v !== null) { if (v < low) low = v; if (v > high) high = v; }
    if (!(low <= high)) return [0, 1];
    const spare = 0.04 * (high - low) || 0.1 * Math.abs(high) || 1;
    return [low - spare, high + spare];
  }

  function chart(holder) {
    const spec = JSON.parse(holder.querySelector("script").textContent);
    const W = 940, H = spec.height || 260;
    const svg = el(holder, "svg", {viewBox: `0 0 ${W} ${H}`, width: "100%", role: "img", "aria-label": spec.y});
    const xs = spec.curves.map(c => c.x).concat(spec.points.map(p => [p.x]));
    const whole = spec.xlim || [Math.min(...xs.map(x => Math.min(...x))), Math.max(...xs.map(x => Math.max(...x)))];
    let range = whole;
    const clip = "clip" + Math.random().toString(36).slice(2);

    function visible(curve) {
      return curve.y.filter((_, i) => curve.x[i] >= range[0] && curve.x[i] <= range[1]);
    }

    function draw() {
      svg.replaceChildren();
      const fixed = spec.ylim && range === whole ? spec.ylim : null;
      const shown = spec.curves.filter(c => !c.hidden);
      const seen = shown.map(visible);
      const [low, high] = fixed || extent(seen.some(s => s.length) ? seen : shown.map(c => c.y));
      const px = x => M.left + (x - range[0]) / (range[1] - range[0]) * (W - M.left - M.right);
      const py = y => H - M.bottom - (y - low) / (high - low) * (H - M.top - M.bottom);
      const at = e => {
        const box = svg.getBoundingClientRect();
        return range[0] + ((e.clientX - box.left) / box.width * W - M.left) / (W - M.left - M.right) * (range[1] - range[0]);
      };
      const defs = el(svg, "defs", {}), path = el(defs, "clipPath", {id: clip});
      el(path, "rect", {x: M.left, y: M.top, width: W - M.left - M.right, height: H - M.top - M.bottom});
      const tx = ticks(range[0], range[1], 8), ty = ticks(low, high, 5);
      for (const x of tx.values) {
        el(svg, "line", {x1: px(x), x2: px(x), y1: M.top, y2: H - M.bottom, class: "grid"});
        el(svg, "text", {x: px(x), y: H - M.bottom + 15, "text-anchor": "middle"}, label(x, tx.step));
      }
      for (const y of ty.values) {
        el(svg, "line", {x1: M.left, x2: W - M.right, y1: py(y), y2: py(y), class: "grid"});
        el(svg, "text", {x: M.left - 6, y: py(y) + 4, "text-anchor": "end"}, label(y, ty.step));
      }
      el(svg, "rect", {x: M.left, y: M.top, width: W - M.left - M.right, height: H - M.top - M.bottom, class: "frame"});
      el(svg, "text", {x: (M.left + W - M.right) / 2, y: H - 8, "text-anchor": "middle"}, spec.x);
      el(svg, "text", {x: 14, y: (M.top + H - M.bottom) / 2, "text-anchor": "middle",
        transform: `rotate(-90 14 ${(M.top + H - M.bottom) / 2})`}, spec.y);
      const inside = el(svg, "g", {"clip-path": `url(#${clip})`});
      for (const t of spec.events) if (t >= range[0] && t <= range[1])
        el(inside, "line", {x1: px(t), x2: px(t), y1: M.top, y2: M.top + 7, class: "event"});
      for (const curve of shown) {
        let d = "", up = true;
        for (let i = 0; i < curve.x.length; i++) {
          if (curve.y[i] === null) { up = true; continue; }
          d += (up ? "M" : "L") + px(curve.x[i]).toFixed(1) + " " + py(curve.y[i]).toFixed(1);
          up = false;
        }
        el(inside, "path", {d: d, class: "curve", stroke: curve.colour, "stroke-dasharray": curve.dash || "none"});
      }
      for (const p of spec.points) {
        el(inside, "circle", {cx: px(p.x), cy: py(p.y), r: 4, class: "point"});
        el(inside, "text", {x: px(p.x) + 6, y: py(p.y) + 13, class: "number"}, p.text);
      }
      const box = el(svg, "rect", {y: M.top, height: H - M.top - M.bottom, class: "selection", width: 0});
      const cursor = el(svg, "line", {y1: M.top, y2: H - M.bottom, class: "cursor", visibility: "hidden"});
      let from = null;
      svg.onmousedown = e => { from = at(e); e.preventDefault(); };
      svg.onmousemove = e => {
        const x = Math.min(Math.max(at(e), range[0]), range[1]);
        cursor.setAttribute("x1", px(x)); cursor.setAttribute("x2", px(x)); cursor.setAttribute("visibility", "visible");
        read(x);
        if (from !== null) {
          box.setAttribute("x", Math.min(px(from), px(x)));
          box.setAttribute("width", Math.abs(px(x) - px(from)));
        }
      };
      svg.onmouseup = e => {
        const to = Math.min(Math.max(at(e), range[0]), range[1]), start = from;
        from = null;
        if (start === null || Math.abs(px(to) - px(start)) < 5) return;
        range = [Math.max(Math.min(start, to), whole[0]), Math.max(start, to)];
        draw();
      };
      svg.onmouseleave = () => { from = null; cursor.setAttribute("visibility", "hidden"); read(null); };
      svg.ondblclick = () => { range = whole; draw(); };
    }

    const legend = holder.querySelector(".legend");
    const entries = spec.curves.map(curve => {
      if (!curve.name) return null;
      const entry = document.createElement("button"), swatch = document.createElement("i"), value = document.createElement("span");
      swatch.style.borderTop = `3px ${curve.dash ? "dashed" : "solid"} ${curve.colour}`;
      entry.append(swatch, curve.name, value);
      entry.onclick = () => { curve.hidden = !curve.hidden; entry.classList.toggle("off", curve.hidden); draw(); };
      legend.append(entry);
      return value;
    });

    function read(x) {
      spec.curves.forEach((curve, k) => {
        if (!entries[k]) return;
        if (x === null) { entries[k].textContent = ""; return; }
        let a = 0, b = curve.x.length - 1;
        while (b - a > 1) { const m = (a + b) >> 1; if (curve.x[m] <= x) a = m; else b = m; }
        const y = curve.y[x - curve.x[a] < curve.x[b] - x ? a : b];
        entries[k].textContent = y === null ? "" : " = " + y.toPrecision(5);
      });
    }

    draw();
  }

  document.querySelectorAll(".chart").forEach(chart);
})();
