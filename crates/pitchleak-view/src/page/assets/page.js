// Draws the charts of a report from the numbers in it: one cursor, one legend and one zoom for all charts over time.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const root = document.documentElement;
  root.classList.remove("no-script");
  const css = (name) => getComputedStyle(root).getPropertyValue(name).trim();
  const ink = (line) => css(`--ink-${line.ink}`);
  const plots = [];
  const legend = document.getElementById("legend");
  const clock = document.getElementById("clock");

  // People's unit for a span of seconds.
  const timeUnit = (span) => (span > 3 * 86400 ? [86400, "days"] : span > 3 * 3600 ? [3600, "h"] : span > 600 ? [60, "min"] : [1, "s"]);
  const span = data.t.length ? data.t[data.t.length - 1] - data.t[0] : 0;
  // A long trace with a clock stands over what the clock shows, in hours since midnight.
  const clocked = data.clock != null && span > 600;
  const shift = clocked ? data.clock : 0;
  if (clocked) data.t = data.t.map((t) => (t == null ? null : t + shift));
  const [second, unitOfTime] = clocked ? [3600, "clock"] : timeUnit(span);
  const two = (value) => String(value).padStart(2, "0");
  const clockText = (t, step) => {
    const whole = Math.round(t), day = Math.floor(whole / 86400), rest = whole - 86400 * day;
    const text = `${two(Math.floor(rest / 3600))}:${two(Math.floor(rest / 60) % 60)}` + (step < 60 ? `:${two(rest % 60)}` : "");
    return day > 0 ? `${text} +${day} d` : text;
  };
  // Steps of the axis in that unit: a third of a minute is none.
  const steps = clocked
    ? [0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400, 172800, 604800]
    : [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 20, 30, 60, 120, 200, 500, 1000].map((step) => step * second);
  const decimals = (step) => {
    let count = 0;
    while (count < 6 && Math.abs(step * 10 ** count - Math.round(step * 10 ** count)) > 1e-6 * step * 10 ** count) count++;
    return count;
  };
  const ticks = (factor) => (u, values) => {
    const step = values.length > 1 ? (values[1] - values[0]) / factor : 1;
    return values.map((value) => (value / factor).toFixed(decimals(step)));
  };
  const clockTicks = (u, values) => values.map((value) => clockText(value, values.length > 1 ? values[1] - values[0] : 1));
  const short = (value) => {
    if (value == null) return "–";
    const size = Math.abs(value);
    return value.toFixed(size >= 100 ? 1 : size >= 10 ? 2 : 3);
  };

  // A line is up to three columns: lower edge, line, upper edge.
  const columns = (chart) => {
    const tables = chart.lines.map((line) => [line.x || data.t, line.low || line.mid, line.mid, line.high || line.mid]);
    return chart.lines.every((line) => !line.x) ? [data.t, ...tables.flatMap((table) => table.slice(1))] : uPlot.join(tables);
  };

  // What a chart shows of its values in sight: all of them, or, of estimates that begin anywhere, what is usual.
  const rangeOf = (chart) => (u) => {
    const [from, to] = u.series[0].idxs || [0, u.data[0].length - 1];
    if (chart.range) return chart.range;
    const wanted = chart.limits.map((limit) => limit.value);
    chart.lines.forEach((line, n) => {
      if (!u.series[3 * n + 2].show) return;
      for (const column of chart.settles ? [3 * n + 2] : [3 * n + 1, 3 * n + 3]) {
        const seen = u.data[column].slice(from, to + 1).filter((value) => value != null).sort((a, b) => a - b);
        const cut = chart.settles ? Math.floor(0.02 * seen.length) : 0;
        if (seen.length) wanted.push(seen[cut], seen[seen.length - 1 - cut]);
      }
    });
    if (!wanted.length) return [0, 1];
    const low = Math.min(...wanted), high = Math.max(...wanted);
    const room = 0.08 * (high - low) || 0.05 * Math.abs(high) || 1;
    return [low - room, high + room];
  };

  const marks = (chart) => (u) => {
    const { left, top, width, height } = u.bbox;
    const ctx = u.ctx;
    ctx.save();
    ctx.beginPath();
    ctx.rect(left, top, width, height);
    ctx.clip();
    for (const { from, to, ink: colour } of chart.spans) {
      const a = u.valToPos(from + shift, "x", true), b = to == null ? left + width : u.valToPos(to + shift, "x", true);
      ctx.globalAlpha = 0.1;
      ctx.fillStyle = css(`--ink-${colour}`);
      ctx.fillRect(a, top, Math.max(b - a, 1), height);
    }
    ctx.globalAlpha = 1;
    ctx.strokeStyle = ctx.fillStyle = css("--faint");
    ctx.setLineDash([6 * devicePixelRatio, 4 * devicePixelRatio]);
    ctx.lineWidth = devicePixelRatio;
    ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
    ctx.textBaseline = "bottom";
    ctx.textAlign = "right";
    for (const { value, label } of chart.limits) {
      const y = Math.round(u.valToPos(value, "y", true)) + 0.5;
      ctx.beginPath();
      ctx.moveTo(left, y);
      ctx.lineTo(left + width, y);
      ctx.stroke();
      ctx.fillText(label, left + width - 6 * devicePixelRatio, y - 2 * devicePixelRatio);
    }
    ctx.restore();
  };

  // Names at the lines' ends, moved apart.
  const endsOf = (u) => {
    const { chart } = u;
    if (chart.lines.length < 2 || !isRoomy(u.width)) return [];
    const { top, height } = u.bbox;
    const [, to] = u.series[0].idxs || [0, u.data[0].length - 1];
    const ends = [];
    chart.lines.forEach((line, n) => {
      if (line.dashed || !u.series[3 * n + 2].show) return;
      let i = to;
      while (i > 0 && u.data[3 * n + 2][i] == null) i--;
      const value = u.data[3 * n + 2][i];
      if (value != null) ends.push({ name: line.name, ink: line.ink, colour: ink(line), y: u.valToPos(value, "y", true) });
    });
    ends.sort((a, b) => a.y - b.y);
    const gap = 13 * devicePixelRatio;
    const [first, last] = [top + gap / 2, top + height - gap / 2];
    ends.forEach((end, n) => { end.y = Math.max(end.y, n ? ends[n - 1].y + gap : first); });
    for (let n = ends.length - 1; n >= 0; n--) ends[n].y = Math.min(ends[n].y, n + 1 < ends.length ? ends[n + 1].y - gap : last);
    return ends;
  };
  const names = (u) => {
    const { left, width } = u.bbox;
    const ctx = u.ctx;
    ctx.save();
    ctx.font = `${12 * devicePixelRatio}px system-ui, sans-serif`;
    ctx.textBaseline = "middle";
    ctx.textAlign = "left";
    for (const end of endsOf(u)) {
      ctx.fillStyle = end.colour;
      ctx.fillText(end.name, left + width + 5 * devicePixelRatio, end.y);
    }
    ctx.restore();
  };
  // The same for all charts, so that their times stand below one another.
  const isRoomy = (width) => width >= 500;
  const height = (width) => (isRoomy(width) ? 220 : 180);
  const widest = (() => {
    const ctx = document.createElement("canvas").getContext("2d");
    ctx.font = "12px system-ui, sans-serif";
    const named = data.charts.flatMap((chart) => (chart.lines.length > 1 ? chart.lines.filter((line) => !line.dashed) : []));
    return Math.max(0, ...named.map((line) => ctx.measureText(line.name).width));
  })();
  const padding = (width) => [10, isRoomy(width) ? widest + 12 : 10, 0, 0];

  const faded = (colour, share) => colour + Math.round(255 * share).toString(16).padStart(2, "0");

  let following = false;
  const follow = (source) => {
    if (following || !source.timed) return;
    following = true;
    const { min, max } = source.scales.x;
    Object.assign(root.dataset, { from: min, to: max });
    plots.filter((u) => u.timed && u !== source).forEach((u) => u.setScale("x", { min, max }));
    following = false;
  };

  const draw = (place, chart) => {
    const timed = chart.lines.every((line) => !line.x);
    const series = [{}];
    const bands = [];
    chart.lines.forEach((line, n) => {
      const edge = { stroke: () => "transparent", width: 0, points: { show: false } };
      const stroke = () => ink(line);
      const mid = { stroke: line.dashed ? () => faded(ink(line), 0.7) : stroke, width: line.bed ? 4 : line.dashed ? 1 : 1.6, dash: line.dashed ? [4, 3] : undefined, points: line.dots ? { show: true, size: 5, fill: stroke } : { show: false } };
      series.push({ ...edge }, mid, { ...edge });
      if (line.low) bands.push({ series: [3 * n + 3, 3 * n + 1], fill: () => faded(ink(line), 0.25) });
    });
    const axis = { stroke: () => css("--faint"), grid: { stroke: () => css("--line"), width: 1 }, ticks: { show: false }, font: "12px system-ui, sans-serif" };
    const label = !timed ? chart.x_label : clocked ? "time of day" : `time, ${unitOfTime}`;
    const u = new uPlot({
      width: place.clientWidth,
      height: height(place.clientWidth),
      padding: [0, 1, 2, 3].map((side) => (self) => padding(self.width)[side]),
      legend: { show: false },
      scales: { x: { time: false }, y: { range: rangeOf(chart) } },
      axes: [
        { ...axis, label, labelSize: 20, labelFont: "12px system-ui, sans-serif", size: 30, values: timed && clocked ? clockTicks : ticks(timed ? second : 1), ...(timed && second > 1 ? { incrs: steps } : {}) },
        { ...axis, size: 58, values: ticks(1) },
      ],
      series, bands,
      cursor: {
        y: false,
        points: { show: (self, n) => n % 3 === 2 },
        drag: { x: true, y: false },
        sync: timed ? { key: "time", scales: ["x", null], filters: { pub: (type) => type === "mousemove" || type === "mouseleave" } } : undefined,
      },
      hooks: {
        drawAxes: [marks(chart)],
        draw: [names],
        setScale: [(self, key) => key === "x" && follow(self)],
        setCursor: timed ? [show] : [],
        init: [(self) => Object.assign(self, { timed, chart, shift: timed ? shift : 0, ends: () => endsOf(self) })],
      },
    }, columns(chart), place);
    plots.push(u);
  };

  // The legend: every line's value under the cursor, a button to hide it; of the charts in sight alone.
  const readouts = [];
  const buttons = [];
  const inSight = (u) => {
    const { top, bottom } = u.root.getBoundingClientRect();
    return bottom > 0 && top < innerHeight;
  };
  const tidy = () => {
    const seen = new Set(plots.filter(inSight));
    for (const { button, drawn } of buttons) button.hidden = !drawn.some(([u]) => seen.has(u));
    for (const group of legend.querySelectorAll(".group")) group.hidden = !group.querySelector("button:not([hidden])");
    legend.hidden = seen.size === 0;
  };
  const show = (u) => {
    const at = u.cursor.idx;
    clock.textContent = at == null ? "point at a chart" : clocked ? clockText(u.data[0][at], 1) : `${(u.data[0][at] / second).toFixed(2)} ${unitOfTime}`;
    for (const { value, plot, n } of readouts) value.textContent = at == null || !plot.timed ? "" : short(plot.data[3 * n + 2][at]);
  };
  const element = (tag, text, className) => {
    const made = document.createElement(tag);
    if (text) made.textContent = text;
    if (className) made.className = className;
    return made;
  };
  const fillLegend = () => {
    const known = new Map();
    for (const plot of plots) {
      const group = element("span", "", "group");
      plot.chart.lines.forEach((line, n) => {
        const same = known.get(`${line.name} ${line.ink}`);
        if (same) return same.push([plot, n]);
        const button = element("button");
        button.type = "button";
        button.setAttribute("aria-pressed", "true");
        const value = element("span");
        button.append(element("span", "", `swatch ink-${line.ink}`), element("span", line.name), value);
        const drawn = [[plot, n]];
        known.set(`${line.name} ${line.ink}`, drawn);
        buttons.push({ button, drawn });
        if (!line.dashed) readouts.push({ value, plot, n });
        button.addEventListener("click", () => {
          const visible = button.getAttribute("aria-pressed") !== "true";
          button.setAttribute("aria-pressed", String(visible));
          for (const [u, k] of drawn) for (const j of [1, 2, 3]) u.setSeries(3 * k + j, { show: visible });
        });
        group.append(button);
      });
      if (!group.childElementCount) continue;
      group.append(element("span", plot.chart.unit));
      legend.insertBefore(group, legend.lastElementChild);
    }
  };

  const timed = () => plots.filter((u) => u.timed);
  const zoom = (factor) => {
    const [u] = timed();
    if (!u) return;
    const { min, max } = u.scales.x;
    const { idx } = u.cursor;
    const centre = idx != null && u.data[0][idx] >= min && u.data[0][idx] <= max ? u.data[0][idx] : (min + max) / 2;
    const [first, last] = [data.t[0], data.t[data.t.length - 1]];
    const next = { min: Math.max(first, centre - (centre - min) * factor), max: Math.min(last, centre + (max - centre) * factor) };
    if (next.max > next.min) u.setScale("x", next);
  };
  const whole = () => timed().slice(0, 1).forEach((u) => u.setScale("x", { min: data.t[0], max: data.t[data.t.length - 1] }));

  const redraw = () => plots.forEach((u) => u.redraw(false, true));
  const fit = () => plots.forEach((u) => {
    const width = u.root.parentElement.clientWidth;
    if (width && width !== u.width) u.setSize({ width, height: height(width) });
  });
  // A table wider than its place is scrolled by the keyboard too.
  const reach = () => document.querySelectorAll(".wide").forEach((box) => {
    const scrolls = box.scrollWidth > box.clientWidth;
    for (const [name, value] of [["tabindex", "0"], ["role", "group"], ["aria-label", "A table that scrolls sideways"]]) {
      if (scrolls) box.setAttribute(name, value);
      else box.removeAttribute(name);
    }
  });

  document.querySelectorAll(".chart").forEach((place) => draw(place, data.charts[Number(place.dataset.chart)]));
  if (plots.length) {
    fillLegend();
    tidy();
    addEventListener("scroll", tidy, { passive: true });
    addEventListener("resize", tidy);
    const [closer, wider, all] = legend.querySelectorAll(".tools button");
    closer.addEventListener("click", () => zoom(0.5));
    wider.addEventListener("click", () => zoom(2));
    all.addEventListener("click", whole);
    if (!timed().length) { legend.querySelector(".tools").hidden = true; clock.hidden = true; }
  }
  reach(); // At once: the observer waits for a frame, and a reader may come before it.
  new ResizeObserver(() => { fit(); reach(); }).observe(document.body);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  matchMedia("print").addEventListener("change", redraw);
  root.plots = plots;
  root.dataset.drawn = String(plots.length);
})();
