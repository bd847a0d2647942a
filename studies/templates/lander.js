"use strict";
// The lander in the 3-D view at one node of a flight: its surface, its plume, and what its sensor sees.
(function () {
  const lander = Report.read("lander-data");
  const amber = "#B87A00", blue = "#3D94D1", orange = "#E69F00", rimRays = 61;

  // Turns the engine's vectors into the site frame: a unit quaternion, of which the page holds the vector part.
  function turner(data, k) {
    const written = data.attitude.map((part) => part[k]), length = Math.max(1, Math.hypot(...written));  // rounding may lead above 1
    const [x, y, z] = written.map((part) => part / length), w = Math.sqrt(Math.max(0, 1 - x * x - y * y - z * z));
    return ([a, b, c]) => {
      const along = x * a + y * b + z * c, size = w * w - x * x - y * y - z * z;
      return [size * a + 2 * (along * x + w * (y * c - z * b)), size * b + 2 * (along * y + w * (z * a - x * c)), size * c + 2 * (along * z + w * (x * b - y * a))];
    };
  }
  function columns(points) { return { x: points.map((p) => p && p[0]), y: points.map((p) => p && p[1]), z: points.map((p) => p && p[2]) }; }
  function placeOf(data, k) { return [data.x[k], data.y[k], data.z[k]]; }
  function sum(a, b) { return a.map((value, axis) => value + b[axis]); }
  function body(turn, place) {
    const { x, y, z } = lander.body;
    return columns(x.map((_, k) => sum(place, turn([x[k], y[k], z[k]]))));
  }
  function plume(turn, nozzle, throttle) {
    const { x, y, z } = lander.plume, [u, v, w] = lander.nozzle;
    return columns(x.map((_, k) => sum(nozzle, turn([x[k] - u, y[k] - v, throttle * (z[k] - w)]))));
  }
  // The edge of the sensor's cone on the target plane, as far as the shown ground goes; none from below it.
  function rim(turn, place, plane, ends) {
    const across = Math.sin(lander.reach), along = -Math.cos(lander.reach), points = [];
    for (let k = 0; k < rimRays; k++) {
      const angle = 2 * Math.PI * k / (rimRays - 1);
      const seen = turn([across * Math.cos(angle), across * Math.sin(angle), along]);
      const reach = (plane - place[2]) / seen[2], point = [place[0] + reach * seen[0], place[1] + reach * seen[1], plane + 1];
      const inside = place[2] > plane && seen[2] < 0 && point.every((value, axis) => axis === 2 || (value >= ends[axis][0] && value <= ends[axis][1]));
      points.push(inside ? point : null);
    }
    return columns(points);
  }
  // Lines from where the newest look was taken to the corners of what it covers.
  function rays(data, view, plane) {
    const taken = placeOf(data, nodeAt(data, view.time)), half = view.width / 2, points = [];
    for (const [east, north] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
      points.push(taken, [view.target[0] + east * half, view.target[1] + north * half, plane + 1], null);
    }
    return columns(points);
  }
  function nodeAt(data, time) {
    const k = data.time.findIndex((value) => value >= time - 0.011);
    return k < 0 ? data.time.length - 1 : k;
  }
  function lookAt(data, k) {
    let newest = 0;
    data.looks.forEach((view, number) => { if (view.time <= data.time[k] + 0.011) newest = number; });
    return newest;
  }
  function thrustAt(data, k) { return k < data.thrust.length ? data.thrust[k] : 0; }
  function describe(data, k) {
    const axis = turner(data, k)([0, 0, 1]), lean = (Math.acos(Math.max(-1, Math.min(1, axis[2]))) * 180 / Math.PI).toFixed(0) + " deg";
    const thrust = thrustAt(data, k), text = data.time[k] + " s: " + thrust + " N";
    if (lander.rigid) return text + ", leans " + lean;
    return text + (thrust > 0 ? ", " + lean + " aside" : "");
  }
  // What moves from node to node, in the order of `traces`.
  function shapes(data, k, ends) {
    const engine = turner(data, k), turn = lander.rigid ? engine : (point) => point, place = placeOf(data, k), plane = data.nominal[2], throttle = thrustAt(data, k) / lander.max_thrust;
    return [
      body(turn, place),
      plume(engine, sum(place, turn(lander.nozzle)), throttle),
      rim(turn, place, plane, ends),
      rays(data, data.looks[lookAt(data, k)], plane),
    ];
  }
  function traces(data, k, ends) {
    const mesh = (surface, more) => {
      const [i, j, l] = surface.triangles;
      return Object.assign({ type: "mesh3d", i, j, k: l, facecolor: surface.colors, flatshading: true, hoverinfo: "skip" }, more);
    };
    const line = (color, width, dash) => ({ type: "scatter3d", mode: "lines", line: { color, width, dash }, hoverinfo: "skip", showlegend: false });
    const looks = [mesh(lander.body, { lighting: { ambient: 0.7 } }), mesh(lander.plume, { color: amber, lighting: { ambient: 1, diffuse: 0 } }), line(blue, 4, "dash"), line(orange, 2, "solid")];
    return shapes(data, k, ends).map((shape, number) => Object.assign(looks[number], shape));
  }
  function move(node, data, k, ends) {
    const now = shapes(data, k, ends), first = node.data.length - now.length;
    Plotly.restyle(node, { x: now.map((s) => s.x), y: now.map((s) => s.y), z: now.map((s) => s.z) }, now.map((_, number) => first + number));
  }
  Report.lander = { traces, move, describe, nodeAt, lookAt, size: lander.size };
})();
