// What is under the pointer, or where the arrow keys are: a mark on each line, and the values below.
for (const chart of document.querySelectorAll("svg.chart")) {
  const lines = JSON.parse(chart.dataset.lines);
  const readout = chart.parentElement.querySelector(".readout");
  if (!readout) continue;
  const marks = lines.map(line => {
    const mark = document.createElementNS("http://www.w3.org/2000/svg", "circle");
    mark.setAttribute("r", 4.5);
    mark.setAttribute("fill", line.colour);
    mark.setAttribute("stroke", "currentColor");
    mark.setAttribute("visibility", "hidden");
    return chart.querySelector("svg").appendChild(mark);
  });
  const number = value => value === null || value === undefined ? "-" : String(value);
  const hint = readout.textContent;
  let index = 0;
  // The place of a time among a line's own times; a run that broke off has fewer.
  const timeOf = (line, i) => line.t ? line.t[i] : line.x[i];
  const placeOf = (line, time) => {
    let low = 0, high = line.x.length - 1;
    while (low < high) { const middle = (low + high) >> 1; if (timeOf(line, middle) < time) low = middle + 1; else high = middle; }
    return low > 0 && Math.abs(timeOf(line, low - 1) - time) <= Math.abs(timeOf(line, low) - time) ? low - 1 : low;
  };
  const show = i => {
    index = Math.max(0, Math.min(i, lines[0].x.length - 1));
    const time = timeOf(lines[0], index), words = [];
    lines.forEach((line, k) => {
      const place = placeOf(line, time), [x, y] = line.at[place];
      if (x === null || y === null) { marks[k].setAttribute("visibility", "hidden"); return; }
      marks[k].setAttribute("cx", x);
      marks[k].setAttribute("cy", y);
      marks[k].setAttribute("visibility", "visible");
      words.push(line.t ? `${line.name}: (${number(line.x[place])}, ${number(line.y[place])}) m` : `${line.name}: ${number(line.y[place])}`);
    });
    readout.textContent = `t = ${number(time)} s · ${words.join(" · ")}`;
  };
  const hide = () => { readout.textContent = hint; marks.forEach(mark => mark.setAttribute("visibility", "hidden")); };
  chart.tabIndex = 0;
  chart.addEventListener("pointermove", event => {
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(chart.getScreenCTM().inverse());
    const path = Boolean(lines[0].t);
    let best = 0, least = Infinity;
    lines[0].at.forEach(([x, y], i) => {
      if (x === null || y === null) return;
      const far = path ? Math.hypot(x - at.x, y - at.y) : Math.abs(x - at.x);
      if (far < least) { least = far; best = i; }
    });
    show(best);
  });
  chart.addEventListener("pointerleave", hide);
  chart.addEventListener("blur", hide);
  chart.addEventListener("keydown", event => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (step) { event.preventDefault(); show(index + step * (event.shiftKey ? 20 : 1)); }
  });
}
// The 3-D view of the chosen settings; another one goes on where the last one was.
for (const views of document.querySelectorAll(".views")) {
  const choice = views.querySelector("select"), place = views.lastElementChild;
  const kept = views.querySelectorAll("template");
  choice.onchange = () => {
    const last = place.firstElementChild?.rollingBalls;
    const {t, playing, arm, up, far} = last?.state ?? {};
    last?.set({playing: false});
    place.querySelector("canvas")?.getContext("webgl2")?.getExtension("WEBGL_lose_context")?.loseContext();
    place.replaceChildren(document.importNode(kept[choice.selectedIndex].content, true));
    if (last) place.firstElementChild.rollingBalls?.set({t, playing, arm, up, far});
  };
  choice.onchange();
}
// Paper can unfold nothing.
addEventListener("beforeprint", () => document.querySelectorAll("details.short").forEach(each => each.open = true));
