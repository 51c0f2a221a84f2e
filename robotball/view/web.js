// WebGL 2 view of rolling balls: orbit, play, scrub. Called once per view.
function rollingBalls(root) {
"use strict";
const data = JSON.parse(root.querySelector("[type='application/json']").textContent);
root.insertAdjacentHTML("beforeend", `
<div data-is="stage"><canvas tabindex="0" role="img"></canvas></div>
<div class="rb-controls">
<button type="button" data-is="play">Play</button>
<input type="range" data-is="time" min="0" max="1" step="any" value="0" aria-label="time">
<label>speed <select data-is="speed">
<option value="0.1">0.1×</option><option value="0.25">0.25×</option><option value="0.5">0.5×</option>
<option value="1" selected>1×</option><option value="2">2×</option><option value="4">4×</option>
</select></label>
<label><input type="checkbox" data-is="ghost"> overlay the balls</label>
</div>
<div data-is="line"></div>
<div class="rb-help">Drag to rotate; click and scroll, or pinch with two fingers, to zoom.</div>
<div data-is="note"></div>`);
const canvas = root.querySelector("canvas"), find = name => root.querySelector(`[data-is=${name}]`);
canvas.setAttribute("aria-label", `${data.label}: ${data.balls.map(ball => ball.name).join(" and ")}`);
find("note").textContent = data.note || "";
const gl = canvas.getContext("webgl2", {alpha: false, antialias: true, stencil: true, preserveDrawingBuffer: true});
if (!gl) { find("line").textContent = "The 3-D view needs WebGL 2, which this browser does not support."; return; }

// Rows of data: contact point x, y, attitude w, x, y, z, hinge angles; lengths in radii.
const floats = text => new Float32Array(Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer);
const WIDTH = 6 + data.hinges, SUN = [-0.3, 0.4, -1], LANE = 1.45, TRAIL = 0.035;
const balls = data.balls.map(ball => ({...ball, rows: floats(ball.rows)}));
const apart = balls.map(ball => floats(ball.apart)), end = data.end, theory = balls.length - 1;

// Vectors, quaternions (w, x, y, z), column-major matrices.
const add = (a, b) => a.map((v, i) => v + b[i]), sub = (a, b) => a.map((v, i) => v - b[i]);
const times = (a, s) => a.map(v => v * s), dot = (a, b) => a.reduce((s, v, i) => s + v * b[i], 0);
const cross = (a, b) => [a[1]*b[2] - a[2]*b[1], a[2]*b[0] - a[0]*b[2], a[0]*b[1] - a[1]*b[0]];
const unit = a => times(a, 1 / (Math.hypot(...a) || 1));
const mul = (p, q) => [
  p[0]*q[0] - p[1]*q[1] - p[2]*q[2] - p[3]*q[3], p[0]*q[1] + p[1]*q[0] + p[2]*q[3] - p[3]*q[2],
  p[0]*q[2] - p[1]*q[3] + p[2]*q[0] + p[3]*q[1], p[0]*q[3] + p[1]*q[2] - p[2]*q[1] + p[3]*q[0]];
const about = (axis, angle) => [Math.cos(angle / 2), ...times(axis, Math.sin(angle / 2))];
const rotate = (q, v) => {
  const u = q.slice(1), t = times(cross(u, v), 2);
  return add(add(v, times(t, q[0])), cross(u, t));
};
const placed = (q, p) => {
  const [x, y, z] = [rotate(q, [1, 0, 0]), rotate(q, [0, 1, 0]), rotate(q, [0, 0, 1])];
  return [...x, 0, ...y, 0, ...z, 0, ...p, 1];
};
const slerp = (a, b, u) => {
  const c = dot(a, b), near = c < 0 ? times(b, -1) : b, angle = Math.acos(Math.min(1, Math.abs(c)));
  if (angle < 1e-4) return unit(add(times(a, 1 - u), times(near, u)));
  return times(add(times(a, Math.sin((1 - u) * angle)), times(near, Math.sin(u * angle))), 1 / Math.sin(angle));
};
const product = (a, b) => Array.from({length: 16}, (_, i) =>
  [0, 1, 2, 3].reduce((s, k) => s + a[4*k + i%4] * b[4*(i>>2) + k], 0));

// Triangles of a shape, rotated about z: [x, y, z, nx, ny, nz] per corner.
function turned(profile, steps) { // a profile curve of [r, z, nr, nz]
  const out = [], corner = ([r, z, nr, nz], k) => {
    const a = 2 * Math.PI * k / steps, c = Math.cos(a), s = Math.sin(a);
    out.push(r*c, r*s, z, nr*c, nr*s, nz);
  };
  for (let k = 0; k < steps; k++) for (let i = 0; i + 1 < profile.length; i++) {
    const p = profile[i], q = profile[i + 1];
    corner(p, k); corner(p, k + 1); corner(q, k + 1); corner(p, k); corner(q, k + 1); corner(q, k);
  }
  return out;
}
const arc = (n, from, to, f) => Array.from({length: n + 1}, (_, i) => {
  const a = from + (to - from) * i / n; return f(Math.cos(a), Math.sin(a));
});
const HALF = Math.PI / 2, SHAPES = {
  torus: ([R, r]) => turned(arc(14, 0, 4 * HALF, (c, s) => [R + r*c, r*s, c, s]), 64),
  sphere: ([r]) => turned(arc(24, -HALF, HALF, (c, s) => [r*c, r*s, c, s]), 48),
  ellipsoid: size => {
    const out = SHAPES.sphere([1]);
    for (let i = 0; i < out.length; i += 6) {
      const n = unit([0, 1, 2].map(k => out[i + k] / size[k]));
      for (let k = 0; k < 3; k++) { out[i + k] *= size[k]; out[i + 3 + k] = n[k]; }
    }
    return out;
  },
  mesh: (size, [vertices, faces]) => { // flat shading: one normal per triangle
    const at = floats(vertices), out = [], numbers = floats(faces);
    for (let i = 0; i < numbers.length; i += 3) {
      const [a, b, c] = [0, 1, 2].map(k => size.map((s, j) => s * at[3 * numbers[i + k] + j]));
      const n = unit(cross(sub(b, a), sub(c, a)));
      out.push(...a, ...n, ...b, ...n, ...c, ...n);
    }
    return out;
  },
  capsule: ([r, h]) => turned([...arc(6, -HALF, 0, (c, s) => [r*c, r*s - h, c, s]),
                               ...arc(6, 0, HALF, (c, s) => [r*c, r*s + h, c, s])], 20),
  cylinder: ([r, h]) => turned([[0, -h, 0, -1], [r, -h, 0, -1], [r, -h, 1, 0], [r, h, 1, 0],
                                [r, h, 0, 1], [0, h, 0, 1]], 40),
  box: size => [0, 1, 2].flatMap(i => [-1, 1].flatMap(side => {
    const n = [0, 0, 0], j = (i + 1) % 3, k = (i + 2) % 3; n[i] = side;
    return [[-1, -1], [1, -1], [1, 1], [-1, -1], [1, 1], [-1, 1]].flatMap(([a, b]) => {
      const p = [0, 0, 0]; p[i] = side * size[i]; p[j] = side * a * size[j]; p[k] = b * size[k];
      return [...p, ...n];
    });
  })),
};
function buffer(numbers) {
  const array = gl.createVertexArray(); gl.bindVertexArray(array);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(numbers), gl.STATIC_DRAW);
  [0, 1].forEach(i => { gl.enableVertexAttribArray(i); gl.vertexAttribPointer(i, 3, gl.FLOAT, false, 24, 12 * i); });
  return {array, count: numbers.length / 6};
}
const bodies = data.bodies.map(body => {
  const parts = {};
  for (const {kind, size, pos, turn, material, mesh} of body.shapes) {
    const corners = SHAPES[kind](size, mesh), into = parts[material] ||= [];
    for (let i = 0; i < corners.length; i += 6)
      into.push(...add(rotate(turn, corners.slice(i, i + 3)), pos), ...rotate(turn, corners.slice(i + 3, i + 6)));
  }
  return {...body, parts: Object.entries(parts).map(([material, numbers]) => ({material, mesh: buffer(numbers)}))};
});
const floor = buffer([[-1, -1], [1, -1], [1, 1], [-1, -1], [1, 1], [-1, 1]].flatMap(([x, y]) => [x, y, 0, 0, 0, 1]));
function stripOf(ball, begin, end, width) { // of samples from begin to before end
  const strip = []; let side = [0, width];
  for (let i = begin; i < Math.min(end, ball.count); i++) {
    const [x, y] = ball.rows.subarray(i * WIDTH), j = Math.min(i + 1, ball.count - 1) * WIDTH;
    const step = [ball.rows[j] - x, ball.rows[j + 1] - y], length = Math.hypot(...step);
    if (length > 1e-6) side = [-step[1] / length * width, step[0] / length * width];
    strip.push(x + side[0], y + side[1], 0, 1, 0, 0, x - side[0], y - side[1], 0, -1, 0, 0);
  }
  return buffer(strip);
}
for (const ball of balls) {
  ball.trail = stripOf(ball, 0, ball.count, TRAIL);
  ball.bands = ball.slips.map(([begin, end]) => ({begin, mesh: stripOf(ball, begin, end, 2.5 * TRAIL)}));
}

// Shading by kind of surface. Floor and paths antialias their edges in the shader.
const KINDS = ["LIT", "FLOOR", "GLASS", "SHADOW", "PATH"];
const HEAD = "#version 300 es\nprecision highp float;\nprecision highp int;\n"
  + KINDS.map((name, i) => `#define ${name} ${i}\n`).join("");
const VERTEX = `
in vec3 corner, normal;
uniform mat4 view, place;
uniform vec3 sun;
uniform int kind;
out vec3 at, n;
void main() {
  vec4 world = place * vec4(corner, 1.0);
  n = mat3(place[0].xyz, place[1].xyz, place[2].xyz) * normal;
  if (kind == SHADOW) world.xyz -= sun * ((world.z - 0.004) / sun.z);
  at = world.xyz;
  gl_Position = view * world;
}
`;
const FRAGMENT = `
out vec4 SEEN;
in vec3 at, n;
uniform vec4 colour;
uniform vec3 eye, sun, look, sky, tile;
uniform int kind;
float tiles(vec2 p) {
  vec2 w = max(fwidth(p), 1e-4);
  vec2 i = 2.0 * (abs(fract((p - 0.5 * w) * 0.5) - 0.5) - abs(fract((p + 0.5 * w) * 0.5) - 0.5)) / w;
  return 0.5 - 0.5 * i.x * i.y;
}
void main() {
  if (kind == FLOOR) {
    float far = smoothstep(8.0, 38.0, distance(at, look));
    SEEN = vec4(mix(mix(tile, tile * 0.92, tiles(at.xy * 0.5)), sky, far), 1.0);
  } else if (kind == PATH) {
    SEEN = vec4(colour.rgb, colour.a * clamp((1.0 - abs(n.x)) / fwidth(n.x), 0.0, 1.0));
  } else if (kind == SHADOW) {
    SEEN = colour;
  } else {
    vec3 to = normalize(eye - at), normal = normalize(n), light = -normalize(sun);
    if (dot(normal, to) < 0.0) normal = -normal;
    float lit = 0.55 + 0.25 * normal.z + 0.35 * max(dot(normal, light), 0.0);
    float shine = pow(max(dot(normal, normalize(light + to)), 0.0), 40.0);
    float glass = kind == GLASS ? 0.45 * pow(1.0 - max(dot(normal, to), 0.0), 3.0) + 0.5 * shine : 0.0;
    SEEN = vec4(colour.rgb * min(lit, 1.15) + 0.25 * shine, min(1.0, colour.a + glass));
  }
}
`;
const program = gl.createProgram();
[gl.VERTEX_SHADER, gl.FRAGMENT_SHADER].forEach((type, i) => {
  const shader = gl.createShader(type); gl.shaderSource(shader, HEAD + [VERTEX, FRAGMENT][i]); gl.compileShader(shader);
  gl.attachShader(program, shader);
});
["corner", "normal"].forEach((name, i) => gl.bindAttribLocation(program, i, name));
gl.linkProgram(program);
if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
gl.useProgram(program);
const uniform = Object.fromEntries(["view", "place", "sun", "kind", "colour", "eye", "look", "sky", "tile"]
  .map(name => [name, gl.getUniformLocation(program, name)]));
const [LIT, FLOOR, GLASS, SHADOW, PATH] = KINDS.keys();
function draw(mesh, kind, place, colour, mode = gl.TRIANGLES, count = mesh.count) {
  gl.uniform1i(uniform.kind, kind); gl.uniformMatrix4fv(uniform.place, false, place);
  gl.uniform4fv(uniform.colour, colour); gl.bindVertexArray(mesh.array); gl.drawArrays(mode, 0, count);
}

const clear = part => data.materials[part.material][3] < .3; // the shell and other transparent parts

// State of the controls.
const dark = matchMedia("(prefers-color-scheme: dark)"), still = matchMedia("(prefers-reduced-motion: reduce)");
const state = {t: 0, playing: !still.matches, speed: 1, ghost: false, arm: data.heading + Math.PI, up: 0.42, far: 8.5};
const bar = find("time");
bar.max = end;

function pose(ball, t) { // interpolated row of a ball at time t
  const x = Math.min(t / data.step, ball.count - 1), i = Math.min(Math.floor(x), Math.max(ball.count - 2, 0)), u = x - i;
  const a = Array.from(ball.rows.subarray(i * WIDTH, (i + 1) * WIDTH));
  const b = ball.count > 1 ? Array.from(ball.rows.subarray((i + 1) * WIDTH, (i + 2) * WIDTH)) : a;
  const mixed = a.map((v, j) => v + (b[j] - v) * u), frame = slerp(a.slice(2, 6), b.slice(2, 6), u);
  const rates = a.map((v, j) => (b[j] - v) / data.step).slice(6);
  return {x: mixed[0], y: mixed[1], frame, angles: mixed.slice(6), rates, row: i};
}
function placesOf(now, centre) { // matrix of each body
  const stands = [], stand = i => stands[i] ||= stoodOn(bodies[i]);
  function stoodOn({parent, hinge, sign, slides, axis, pivot}) {
    if (parent < 0) return [now.frame, centre];
    const [q, p] = stand(parent), angle = sign * now.angles[hinge], turn = about(axis, slides ? 0 : angle);
    return [mul(q, turn), add(p, rotate(q, slides ? times(axis, angle) : sub(pivot, rotate(turn, pivot))))];
  }
  return bodies.map((_, i) => placed(...stand(i)));
}

function frame() {
  const ratio = Math.min(devicePixelRatio || 1, 2), w = Math.round(canvas.clientWidth * ratio), h = Math.round(canvas.clientHeight * ratio);
  if (!w || !h) return;
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  const sky = dark.matches ? [.11, .12, .14] : [.96, .965, .97], tile = dark.matches ? [.24, .26, .29] : [.89, .9, .915];
  const across = [-Math.sin(data.heading), Math.cos(data.heading)];
  const nows = balls.map((ball, i) => {
    const now = pose(ball, state.t), lane = state.ghost ? 0 : LANE * (2 * i - theory);
    return {...now, lane: [lane * across[0], lane * across[1], 0]};
  });
  const centres = nows.map(now => add([now.x, now.y, 1], now.lane));
  const look = times(centres.reduce(add), 1 / centres.length);
  const spread = Math.max(...centres.map(centre => Math.hypot(...sub(centre, centres[theory]))));
  look[2] = .8;
  const far = state.far * Math.max(1, spread / 3.5) * Math.max(1, 1.35 * h / w);
  const back = [Math.cos(state.arm) * Math.cos(state.up), Math.sin(state.arm) * Math.cos(state.up), Math.sin(state.up)];
  const eye = add(look, times(back, far)), right = unit(cross([0, 0, 1], back)), top = cross(back, right);
  const f = 3.1, near = .1, most = 300;
  const lens = [f * Math.min(1, h / w), 0, 0, 0, 0, f * Math.min(1, h / w) * w / h, 0, 0, 0, 0, (near + most) / (near - most), -1, 0, 0, 2 * near * most / (near - most), 0];
  const turn = [0, 1, 2].flatMap(i => [right[i], top[i], back[i], 0]);
  const view = product(lens, [...turn, -dot(right, eye), -dot(top, eye), -dot(back, eye), 1]);

  gl.viewport(0, 0, w, h); gl.clearColor(...sky, 1); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
  gl.uniformMatrix4fv(uniform.view, false, view); gl.uniform3fv(uniform.eye, eye); gl.uniform3fv(uniform.look, look);
  gl.uniform3fv(uniform.sun, SUN); gl.uniform3fv(uniform.sky, sky); gl.uniform3fv(uniform.tile, tile);
  gl.enable(gl.DEPTH_TEST); gl.enable(gl.BLEND); gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  const ground = placed([1, 0, 0, 0], [look[0], look[1], 0]);
  for (let i = 0; i < 12; i++) ground[i] *= 60;
  draw(floor, FLOOR, ground, [0, 0, 0, 1]);
  gl.disable(gl.DEPTH_TEST); // shadows and paths are drawn over the floor
  const drawn = balls.map((ball, i) => ({ball, now: nows[i], places: placesOf(nows[i], centres[i])}));
  const forEachPart = (list, f) => list.forEach(one => bodies.forEach((body, j) => body.parts.forEach(part => f(one, part, one.places[j], body))));
  gl.enable(gl.STENCIL_TEST); gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
  if (eye[2] > 0) for (const [level, glass] of [[0, true], [1, false]]) { // the stencil keeps pixels from being darkened twice
    gl.stencilFunc(gl.GEQUAL, level, 255);
    forEachPart(drawn, (one, part, place) => {
      if (clear(part) === glass && part.material !== "blur") draw(part.mesh, SHADOW, place, [0, 0, 0, glass ? .13 : .2]);
    });
  }
  gl.disable(gl.STENCIL_TEST);
  const drawPath = (mesh, {lane, row}, colour, begin = 0) => draw(mesh, PATH, placed([1, 0, 0, 0], add(lane, [0, 0, .006])), [...colour, 1],
    gl.TRIANGLE_STRIP, Math.max(0, Math.min(mesh.count, 2 * (row + 1 - begin))));
  drawn.forEach(({ball, now}) => ball.bands.forEach(({begin, mesh}) => drawPath(mesh, now, data.band, begin)));
  drawn.forEach(({ball, now}) => drawPath(ball.trail, now, ball.colour));
  gl.enable(gl.DEPTH_TEST);
  const turns = now => bodies.map(body => !body.marked ? 0 : Math.min(1, Math.max(0, (Math.abs(now.rates[body.hinge]) * state.speed * (state.playing ? 1 : 0) / 60 - .25) / .5)));
  const glassy = [];
  drawn.forEach((one, i) => {
    const fast = turns(one.now), dim = state.ghost && theory && i === theory ? .35 : 1;
    bodies.forEach((body, j) => body.parts.forEach(part => {
      const coloured = part.material === "shell" || part.material === "mark", [r, g, b, a] = data.materials[part.material];
      let alpha = a * dim;
      if (part.material === "spoke") alpha *= 1 - fast[j];
      if (part.material === "blur") alpha *= fast[j];
      const job = [part.mesh, clear(part) ? GLASS : LIT, one.places[j], [...(coloured ? one.ball.colour : [r, g, b]), alpha]];
      if (alpha > .99) draw(...job); else if (alpha > .01) glassy.push(job);
    }));
  });
  gl.enable(gl.CULL_FACE); gl.depthMask(false);
  for (const side of [gl.FRONT, gl.BACK]) { gl.cullFace(side); glassy.forEach(job => draw(...job)); }
  gl.disable(gl.CULL_FACE); gl.depthMask(true);

  const taken = [], stage = find("stage");
  centres.forEach((centre, i) => { // names below the balls, as HTML, without overlaps
    const gap = apart[i][Math.min(Math.round(state.t / data.step), apart[i].length - 1)], label = labels[i];
    const slips = balls[i].slips.some(([begin, end]) => begin <= nows[i].row && nows[i].row < end);
    label.textContent = balls[i].name + (slips ? ", slipping" : "") + (i < theory ? `\n${gap < 1e-3 && gap > 0 ? gap.toExponential(1) : gap.toPrecision(3)} m off` : "");
    const p = [centre[0], centre[1], -.15], clip = [0, 1, 3].map(k => view[k]*p[0] + view[4+k]*p[1] + view[8+k]*p[2] + view[12+k]);
    const half = label.offsetWidth / 2, high = label.offsetHeight, width = stage.clientWidth;
    const x = Math.min(Math.max((clip[0] / clip[2] + 1) / 2 * width, half), width - half);
    let y = (1 - clip[1] / clip[2]) / 2 * stage.clientHeight;
    for (const other of taken.sort((a, b) => a.y - b.y))
      if (Math.abs(x - other.x) < half + other.half && y < other.y + other.high && other.y < y + high) y = other.y + other.high + 2;
    label.style.left = `${x}px`; label.style.top = `${y}px`;
    taken.push({x, y, half, high});
  });
  bar.value = state.t;
  find("line").textContent = `t = ${state.t.toFixed(2)} s`
    + (balls.some(ball => state.t > (ball.count - .5) * data.step && ball.count < data.count) ? " · a run ended early" : "");
  find("play").textContent = state.playing ? "Pause" : "Play";
  root.dataset.drawn = state.t;
}
const labels = balls.map(({colour}) => {
  const label = document.createElement("span"); label.className = "rb-name";
  label.style.borderTop = `3px solid rgb(${times(colour, 255).map(Math.round)})`;
  find("stage").append(label); return label;
});

let before = 0, wanted = false;
function tick(now) {
  wanted = false;
  if (state.playing) state.t = (state.t + Math.min(.1, (now - before) / 1000) * state.speed) % (end || 1);
  before = now; frame();
  if (state.playing && !document.hidden) want();
}
function want() { if (!wanted) { wanted = true; requestAnimationFrame(tick); } }
const set = change => { Object.assign(state, change); before = performance.now(); want(); };
find("play").onclick = () => set({playing: !state.playing, t: state.t >= end ? 0 : state.t});
bar.oninput = () => set({t: +bar.value, playing: false});
find("speed").onchange = event => set({speed: +event.target.value});
find("ghost").onchange = event => set({ghost: event.target.checked});
find("ghost").closest("label").hidden = balls.length < 2;
const held = new Map();
canvas.onpointerdown = event => { held.set(event.pointerId, [event.clientX, event.clientY]); canvas.setPointerCapture?.(event.pointerId); };
canvas.onpointerup = canvas.onpointercancel = event => held.delete(event.pointerId);
canvas.onpointermove = event => {
  const last = held.get(event.pointerId); if (!last) return;
  const now = [event.clientX, event.clientY], gap = () => { const [p, q] = [...held.values()]; return Math.hypot(p[0] - q[0], p[1] - q[1]); };
  if (held.size > 1) { const old = gap(); held.set(event.pointerId, now); zoom(old / gap()); return; }
  held.set(event.pointerId, now);
  set({arm: state.arm - (now[0] - last[0]) * .008, up: Math.min(1.5, Math.max(.05, state.up + (now[1] - last[1]) * .008))});
};
const zoom = by => set({far: Math.min(60, Math.max(3, state.far * by))});
canvas.addEventListener("wheel", event => { if (event.ctrlKey || document.activeElement === canvas) { event.preventDefault(); zoom(Math.exp(event.deltaY * .001)); } }, {passive: false});
canvas.onkeydown = event => {
  const keys = {ArrowLeft: {arm: state.arm - .1}, ArrowRight: {arm: state.arm + .1}, ArrowUp: {up: Math.min(1.5, state.up + .06)}, ArrowDown: {up: Math.max(.05, state.up - .06)}, " ": {playing: !state.playing}};
  if (keys[event.key]) { event.preventDefault(); set(keys[event.key]); }
  if (event.key === "+" || event.key === "-") zoom(event.key === "+" ? .9 : 1.1);
};
new ResizeObserver(want).observe(canvas);
document.addEventListener("visibilitychange", want); dark.addEventListener("change", want);
root.rollingBalls = {state, set, places: () => { const now = pose(balls[0], state.t); return placesOf(now, [now.x, now.y, 1]); }};
want();
}
