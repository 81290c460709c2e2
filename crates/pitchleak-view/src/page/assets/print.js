// For paper: each chart as an SVG, drawn from the same numbers where the screen has pixels.
"use strict";
(() => {
  const root = document.documentElement;
  const element = (name, attributes, ...inner) => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    made.append(...inner);
    return made;
  };
  const near = (value) => Math.round(10 * value) / 10;

  // Runs of points that follow one another: null ends a run, undefined is another line's place.
  const runs = (xs, columns, from, to) => {
    const all = [[]];
    for (let i = from; i <= to; i++) {
      const values = columns.map((column) => column[i]);
      if (values.some((value) => value === null)) all.push([]);
      else if (values.every((value) => value !== undefined)) all[all.length - 1].push([xs[i], ...values]);
    }
    return all.filter((run) => run.length);
  };

  const drawing = (u) => {
    const { left, top, width, height } = u.bbox;
    const dot = devicePixelRatio;
    const x = (value) => near(u.valToPos(value, "x", true)), y = (value) => near(u.valToPos(value, "y", true));
    const text = (at, anchor, value, fill = "var(--faint)") =>
      element("text", { x: near(at[0]), y: near(at[1]), "text-anchor": anchor, fill, "font-size": 12 * dot }, value);
    const clip = `clip-${plotsOf().indexOf(u)}`;
    const inside = element("g", { "clip-path": `url(#${clip})`, fill: "none" });
    const outside = element("g", { "font-family": "system-ui, sans-serif" });
    const grid = (x1, y1, x2, y2) => inside.append(element("line", { x1, y1, x2, y2, stroke: "var(--line)", "stroke-width": dot }));
    const [bottom, side] = u.axes;
    (bottom._splits || []).forEach((value, n) => {
      grid(x(value), top, x(value), top + height);
      outside.append(text([x(value), top + height + 16 * dot], "middle", bottom._values[n] ?? ""));
    });
    (side._splits || []).forEach((value, n) => {
      grid(left, y(value), left + width, y(value));
      outside.append(text([left - 6 * dot, y(value) + 4 * dot], "end", side._values[n] ?? ""));
    });
    outside.append(text([left + width / 2, top + height + 36 * dot], "middle", bottom.label));
    for (const { from, to, ink } of u.chart.spans) {
      const [start, end] = [x(from + u.shift), to == null ? left + width : x(to + u.shift)];
      inside.append(element("rect", { x: start, y: top, width: Math.max(end - start, 1), height, fill: `var(--ink-${ink})`, opacity: 0.1 }));
    }
    for (const { value, label } of u.chart.limits) {
      inside.append(element("line", { x1: left, x2: left + width, y1: y(value), y2: y(value), stroke: "var(--faint)", "stroke-width": dot, "stroke-dasharray": `${6 * dot} ${4 * dot}` }));
      outside.append(text([left + width - 6 * dot, y(value) - 4 * dot], "end", label));
    }
    const [from, to] = u.series[0].idxs || [0, u.data[0].length - 1];
    u.chart.lines.forEach((line, n) => {
      if (!u.series[3 * n + 2].show) return;
      const colour = `var(--ink-${line.ink})`;
      const [low, mid, high] = [1, 2, 3].map((column) => u.data[3 * n + column]);
      const path = (points) => points.map(([t, value]) => `${x(t)} ${y(value)}`).join("L");
      if (line.low) {
        const bands = runs(u.data[0], [low, high], from, to).map((run) => `M${path(run)}L${path(run.map(([t, , value]) => [t, value]).reverse())}Z`);
        inside.append(element("path", { d: bands.join(""), fill: colour, opacity: 0.25 }));
      }
      const pieces = runs(u.data[0], [mid], from, to);
      inside.append(element("path", {
        d: pieces.map((run) => `M${path(run)}`).join(""), stroke: colour, "stroke-width": (line.bed ? 4 : line.dashed ? 1 : 1.6) * dot,
        ...(line.dashed ? { "stroke-dasharray": `${4 * dot} ${3 * dot}` } : {}) }));
      if (line.dots) inside.append(...pieces.flat().map(([t, value]) => element("circle", { cx: x(t), cy: y(value), r: 2.5 * dot, fill: colour })));
    });
    for (const end of u.ends()) outside.append(text([left + width + 5 * dot, end.y + 4 * dot], "start", end.name, `var(--ink-${end.ink})`));
    const frame = element("clipPath", { id: clip }, element("rect", { x: left, y: top, width, height }));
    const { width: all, height: tall } = u.ctx.canvas;
    return element("svg", { class: "print", viewBox: `0 0 ${all} ${tall}`, "aria-hidden": "true" }, frame, inside, outside);
  };

  const plotsOf = () => root.plots || [];
  addEventListener("beforeprint", () => {
    plotsOf().forEach((u) => u.root.parentElement.append(drawing(u)));
    root.classList.add("printing");
  });
  addEventListener("afterprint", () => {
    document.querySelectorAll("svg.print").forEach((svg) => svg.remove());
    root.classList.remove("printing");
  });
})();
