// The queries of an evaluation on one canvas, and lines to their best places on another;
// `queryLayer` switches an outcome, or the lines, on and off. By `key` they are known to the page.
semsig.queries = (map, key, packed, about) => {
  const {outcomes, fields, signs} = about;
  const on = new Set();
  const sprites = {};
  const set = {about, data: null, layers: [], chosen: null};
  let board = null;
  let silence = null;
  const frame = () => semsig.frame(map, {origin: [0, 0], quantum: 1});
  const isOn = (one) => on.has(set.data.outcome[one]) && set.chosen[one] === 1;
  set.ready = semsig.arrays(packed).then((data) => {
    const metres = (name) => {
      const [x, y] = [0, 1].map(() => new Float64Array(data.outcome.length));
      for (let one = 0; one < x.length; one += 1) {
        const place = set.placeOf(one, name);
        ({x: x[one], y: y[one]} = L.CRS.EPSG3857.project(L.latLng(place)));
      }
      return [x, y];
    };
    set.data = data;
    [data.x, data.y] = metres("places");
    [data.bestX, data.bestY] = metres("best");
    set.chosen = new Uint8Array(data.outcome.length).fill(1);
    set.redraw();
    return set;
  });
  set.placeOf = (one, name = "places") =>
    [2 * one, 2 * one + 1].map((at) => set.data[name][at] / 1e6);
  // The numbers of the queries that are selected, from 0: those that are drawn.
  set.selection = () => [...set.data.outcome.keys()].filter(isOn);
  // From afar smaller, lest they hide what they lie on; many more so.
  const radiusAt = (zoom) => (about.count <= 2000
    ? 5 * Math.min(1, Math.max(0.5, (zoom - 9) / 5)) : zoom >= 16 ? 5 : zoom >= 14 ? 3.5 : 2.5);
  const spriteOf = (outcome, radius, dots) => {
    const name = [outcome, radius, dots].join();
    const {outline, colour, edge} = outcomes[outcome];
    sprites[name] = sprites[name] || semsig.sprite((radius + 2) * dots, (ctx) => {
      const path = new Path2D(outline);
      ctx.scale(radius * dots, radius * dots);
      ctx.fillStyle = colour;
      ctx.fill(path);
      ctx.lineWidth = 1.5 / radius;
      ctx.strokeStyle = edge;
      ctx.stroke(path);
    });
    return sprites[name];
  };
  const paint = (ctx, min, max) => {
    if (set.data === null) return;
    semsig.stamped(ctx, min, max, (dots, stamp) => {
      const {x, y, outcome} = set.data;
      const {scale, left, top} = frame();
      const radius = radiusAt(map.getZoom());
      const stamps = outcomes.map((_, at) => spriteOf(at, radius, dots));
      // The rarer last, so that they lie on top.
      for (const kind of about.order) {
        for (let one = 0; one < x.length; one += 1) {
          if (outcome[one] !== kind || !isOn(one)) continue;
          stamp(stamps[kind], x[one] * scale + left, top - y[one] * scale);
        }
      }
    });
  };
  const paintLines = () => (ctx) => {
    if (set.data === null) return;
    const {x, y, bestX, bestY, located, outcome} = set.data;
    const {scale, left, top} = frame();
    ctx.globalAlpha = 0.6;
    for (const [at, {colour}] of outcomes.entries()) {
      ctx.beginPath();
      for (let one = 0; one < x.length; one += 1) {
        if (outcome[one] !== at || !located[one] || !isOn(one)) continue;
        ctx.moveTo(x[one] * scale + left, top - y[one] * scale);
        ctx.lineTo(bestX[one] * scale + left, top - bestY[one] * scale);
      }
      ctx.strokeStyle = colour;
      ctx.stroke();
    }
  };
  const lines = semsig.boardLayer("shadowPane", "semsig-lines", paintLines);
  set.redraw = () => {
    if (board) board.redraw();
    lines.redraw();
  };
  const nameOf = (one) =>
    `Query ${(one + 1).toLocaleString("en")}: ${outcomes[set.data.outcome[one]].name}`;
  const tell = (one) => {
    const place = set.placeOf(one);
    const drawn = L.layerGroup([L.circleMarker(place, {
      pane: "shadowPane", interactive: false, color: semsig.pointed, fill: false,
      radius: 11, weight: 3,
    })]);
    const found = set.data.located[one] ? [set.placeOf(one, "best"), ...set.data.next[one]] : [];
    if (found.length) drawn.addLayer(semsig.hint(place, found));
    semsig.show(map, semsig.details(nameOf(one), fields, set.data.details[one], signs), place, {
      key: `query:${one + 1}`, corners: found, drawn,
    });
  };
  const answer = ({latlng}) => {
    if (set.data === null) return false;
    const {x, y} = set.data;
    const point = map.latLngToLayerPoint(latlng);
    const {scale, left, top} = frame();
    let [best, least] = [-1, 10 ** 2];
    for (let one = 0; one < x.length; one += 1) {
      const away = (x[one] * scale + left - point.x) ** 2 + (top - y[one] * scale - point.y) ** 2;
      if (away <= least && isOn(one)) [best, least] = [one, away];
    }
    if (best >= 0) tell(best);
    return best >= 0;
  };
  semsig.addOpener("query", (_, rest) => {
    const one = Number(rest) - 1;
    if (!(Number.isInteger(one) && one >= 0 && one < about.count)) return false;
    if (set.data) tell(one);
    else set.ready.then(() => tell(one));
    return true;
  });
  semsig.finders.push((words, limit) => {
    if (set.data === null) return [];
    // What has a number is called by it alone, too.
    set.names = set.names || [...set.data.outcome.keys()].map(
      (one) => semsig.plain(`${nameOf(one)}\n${one + 1}`));
    return semsig.matches(set.names, words, limit).map(({rank, at}) => ({
      rank,
      name: nameOf(at),
      hint: "",
      show: () => {
        semsig.reveal(map, set.layers[set.data.outcome[at]], set.placeOf(at));
        tell(at);
      },
    }));
  });
  const layerOf = (number) => {
    const layer = new L.Layer();
    layer.onAdd = () => {
      if (!on.size) {
        board = semsig.board(map, "markerPane", paint);
        silence = semsig.answers(map, 0, answer);
      }
      on.add(number);
      set.redraw();
    };
    layer.onRemove = () => {
      on.delete(number);
      set.redraw();
      if (on.size) return;
      silence();
      board.remove();
      board = null;
    };
    return layer;
  };
  set.layers = [...outcomes.map((_, number) => layerOf(number)), lines];
  semsig.held[key] = set;
  semsig.filters(map, key);
};
semsig.queryLayer = (key, number) => semsig.held[key].layers[number];
