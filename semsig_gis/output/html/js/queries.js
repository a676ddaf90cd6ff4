// The queries of an evaluation on a canvas, and lines to their best places on another; `queryLayer`
// returns the layer of an outcome or of the lines, by the `key` of the evaluation.
semsig.queries = (map, key, packed, about) => {
  const {outcomes, fields, signs} = about;
  const on = new Set();
  const sprites = {};
  const set = {about, data: null, layers: [], selected: null};
  let board = null;
  let stopAnswering = null;
  const frame = () => semsig.frame(map, {origin: [0, 0], quantum: 1});
  const isOn = (query) => on.has(set.data.outcome[query]) && set.selected[query] === 1;
  set.ready = semsig.arrays(packed).then((data) => {
    const metres = (name) => {
      const [x, y] = [0, 1].map(() => new Float64Array(data.outcome.length));
      for (let query = 0; query < x.length; query += 1) {
        const place = set.placeOf(query, name);
        ({x: x[query], y: y[query]} = L.CRS.EPSG3857.project(L.latLng(place)));
      }
      return [x, y];
    };
    set.data = data;
    [data.x, data.y] = metres("places");
    [data.bestX, data.bestY] = metres("best");
    set.selected = new Uint8Array(data.outcome.length).fill(1);
    set.redraw();
    return set;
  });
  set.placeOf = (query, name = "places") =>
    [2 * query, 2 * query + 1].map((at) => set.data[name][at] / 1e6);
  // Indices of the queries that are drawn.
  set.selection = () => [...set.data.outcome.keys()].filter(isOn);
  // Smaller at low zoom, and if there are many queries, so that they do not hide the map.
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
      // The rarer outcome last, so that it lies on top.
      for (const kind of about.order) {
        for (let query = 0; query < x.length; query += 1) {
          if (outcome[query] !== kind || !isOn(query)) continue;
          stamp(stamps[kind], x[query] * scale + left, top - y[query] * scale);
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
      for (let query = 0; query < x.length; query += 1) {
        if (outcome[query] !== at || !located[query] || !isOn(query)) continue;
        ctx.moveTo(x[query] * scale + left, top - y[query] * scale);
        ctx.lineTo(bestX[query] * scale + left, top - bestY[query] * scale);
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
  const nameOf = (query) =>
    `Query ${(query + 1).toLocaleString("en")}: ${outcomes[set.data.outcome[query]].name}`;
  const showQuery = (query) => {
    const place = set.placeOf(query);
    const drawn = L.layerGroup([L.circleMarker(place, {
      pane: "shadowPane", interactive: false, color: semsig.highlight, fill: false,
      radius: 11, weight: 3,
    })]);
    const places = set.data.located[query]
      ? [set.placeOf(query, "best"), ...set.data.next[query]] : [];
    if (places.length) drawn.addLayer(semsig.hint(place, places));
    const [rows, values] = [
      [...fields, "Latitude, longitude"],
      [...set.data.details[query], place.map((part) => part.toFixed(6)).join(", ")]];
    semsig.show(map, semsig.details(nameOf(query), rows, values, signs), place, {
      key: `query:${query + 1}`, corners: places, drawn,
    });
  };
  const answer = ({latlng}) => {
    if (set.data === null) return false;
    const {x, y} = set.data;
    const point = map.latLngToLayerPoint(latlng);
    const {scale, left, top} = frame();
    let [best, least] = [-1, 10 ** 2];
    for (let query = 0; query < x.length; query += 1) {
      const [right, down] = [x[query] * scale + left - point.x, top - y[query] * scale - point.y];
      const away = right ** 2 + down ** 2;
      if (away <= least && isOn(query)) [best, least] = [query, away];
    }
    if (best >= 0) showQuery(best);
    return best >= 0;
  };
  semsig.addOpener("query", (_, rest) => {
    const query = Number(rest) - 1;
    if (!(Number.isInteger(query) && query >= 0 && query < about.count)) return false;
    if (set.data) showQuery(query);
    else set.ready.then(() => showQuery(query));
    return true;
  });
  semsig.finders.push((words, limit) => {
    if (set.data === null) return [];
    // The number of a query is a name too.
    set.names = set.names || [...set.data.outcome.keys()].map(
      (query) => semsig.plain(`${nameOf(query)}\n${query + 1}`));
    return semsig.matches(set.names, words, limit).map(({rank, at}) => ({
      rank,
      name: nameOf(at),
      hint: "",
      show: () => {
        semsig.reveal(map, set.layers[set.data.outcome[at]], set.placeOf(at));
        showQuery(at);
      },
    }));
  });
  const layerOf = (number) => {
    const layer = new L.Layer();
    layer.onAdd = () => {
      if (!on.size) {
        board = semsig.board(map, "markerPane", paint);
        stopAnswering = semsig.answers(map, 0, answer);
      }
      on.add(number);
      set.redraw();
    };
    layer.onRemove = () => {
      on.delete(number);
      set.redraw();
      if (on.size) return;
      stopAnswering();
      board.remove();
      board = null;
    };
    return layer;
  };
  set.layers = [...outcomes.map((_, number) => layerOf(number)), lines];
  semsig.layerSets[key] = set;
  semsig.filters(map, key);
};
semsig.queryLayer = (key, number) => semsig.layerSets[key].layers[number];
