// Layers of street objects or queries by the key of their data.
semsig.layerSets = {};
// Street objects of all classes on one canvas; `classLayer` returns the layer of one class.
semsig.streetObjects = (key, packed, about) => {
  const {classes, sources, fields, texts} = about;
  const visible = new Set();
  const chunk = 256;
  let data = null;
  let board = null;
  let layers = [];
  let stopAnswering = null;
  const sprites = {};
  const ready = semsig.arrays(packed).then((arrays) => {
    data = arrays;
    for (const item of classes) {
      const starts = [];
      for (let at = item.start; at < item.end; at += chunk) starts.push(at);
      starts.push(item.end);
      item.starts = starts;
      item.boxes = semsig.blocks(data.x, data.y, starts);
    }
    const named = ["text.name", "text.brand"].filter((column) => column in texts);
    data.names = data.ids.map((id, object) => semsig.plain(
      [id, ...named.map((column) => data[column][object])].join("\n")));
    if (board) board.redraw();
  });
  // Radius of signs by zoom; large signs show the shape of the class, the largest its pictogram.
  const sizes = [[12, 1], [13.5, 1.5], [15, 2.2], [16.5, 4], [17.5, 6], [19, 9], [Infinity, 12]];
  const sizeAt = (zoom) => sizes.find(([below]) => zoom < below)[1];
  const spriteOf = (number, size, dark, dots) => {
    const name = [number, size, dark, dots].join();
    const {outline, colour, ink, pictogram} = classes[number];
    sprites[name] = sprites[name] || semsig.sprite((1.3 * size + 1) * dots, (ctx) => {
      ctx.scale(size * dots, size * dots);
      const path = new Path2D(size >= 9 ? semsig.disc : outline);
      ctx.fillStyle = colour;
      ctx.fill(path);
      if (size >= 4) {
        ctx.lineWidth = 1 / size;
        const bright = ink === "#000000";
        ctx.strokeStyle = dark ? "#131518" : bright ? "#444" : "#fff";
        ctx.stroke(path);
      }
      if (size >= 9) semsig.paintPictogram(ctx, pictogram, ink);
    });
    return sprites[name];
  };
  // Calls a function with each object of a class in a box of pixels.
  const within = (frame, {starts, boxes}, min, max, call) => {
    const {scale, left, top} = frame;
    for (let block = 0; block + 1 < starts.length; block += 1) {
      const at = 4 * block;
      if (boxes[at + 2] * scale + left < min.x || boxes[at] * scale + left > max.x
        || top - boxes[at + 1] * scale < min.y || top - boxes[at + 3] * scale > max.y) continue;
      for (let object = starts[block]; object < starts[block + 1]; object += 1) {
        const x = data.x[object] * scale + left;
        const y = top - data.y[object] * scale;
        if (x >= min.x && x <= max.x && y >= min.y && y <= max.y) call(x, y, object);
      }
    }
  };
  const paint = (map) => (ctx, min, max) => {
    if (data === null) return;
    semsig.stamped(ctx, min, max, (dots, stamp) => {
      const size = sizeAt(map.getZoom());
      for (const number of about.order) {
        if (!visible.has(number)) continue;
        // Of an extended thing only one point has a large sign.
        const [sprite, small] = [size, Math.min(size, 2.2)].map(
          (radius) => spriteOf(number, radius, semsig.isDark(map), dots));
        const frame = semsig.frame(map, about);
        within(frame, classes[number], min, max, (x, y, object) =>
          stamp(data.part?.[object] ? small : sprite, x, y));
      }
    });
  };
  const placeOf = (object) => L.CRS.EPSG3857.unproject(L.point(
    about.origin[0] + data.x[object] * about.quantum,
    about.origin[1] + data.y[object] * about.quantum));
  const classOf = (object) => classes.findIndex(({start, end}) => start <= object && object < end);
  // The key in the address: number of the layer, if there are several, and index of the object.
  const keyOf = (object) => `${key.replace("objects", "")}/${object}`;
  const showObject = (map, object) => {
    const {title} = classes[classOf(object)];
    const place = placeOf(object);
    const read = Object.entries(texts).map(([column, label]) => [label, data[column][object]])
      .filter(([, text]) => text);
    const values = [
      title, ...read.map(([, text]) => text), sources[data.source[object]], data.ids[object],
      data.count[object] > 1 ? `${data.count[object]} rows of its source` : null,
      data.merged[object] || null,
      `${place.lat.toFixed(6)}, ${place.lng.toFixed(6)}`,
    ];
    const rows = [fields[0], ...read.map(([label]) => label), ...fields.slice(1)];
    const mark = L.circleMarker(place, {pane: "shadowPane", interactive: false, fill: false,
      radius: 13, color: semsig.highlight, weight: 3});
    semsig.show(map, semsig.details(title, rows, values, {}), place, {
      key: `object:${keyOf(object)}`, drawn: mark,
    });
  };
  semsig.addOpener("object", (map, rest) => {
    const [layer, object] = rest.split("/");
    const number = Number(object);
    const exists = `objects${layer}` === key && classOf(number) >= 0;
    if (exists) {
      ready.then(() => {
        map.addLayer(layers[classOf(number)]);
        showObject(map, number);
      });
    }
    return exists;
  });
  const answer = (map) => (event) => {
    if (data === null) return false;
    const point = map.latLngToLayerPoint(event.latlng);
    const frame = semsig.frame(map, about);
    const reach = Math.max(10, sizeAt(map.getZoom()));
    let [best, least] = [-1, reach ** 2];
    for (const number of visible) {
      within(frame, classes[number], point.subtract([reach, reach]), point.add([reach, reach]),
        (x, y, object) => {
          const away = (x - point.x) ** 2 + (y - point.y) ** 2;
          if (away <= least) [best, least] = [object, away];
        });
    }
    if (best >= 0) showObject(map, best);
    return best >= 0;
  };
  const layerOf = (number) => {
    const layer = new L.Layer();
    layer.onAdd = (map) => {
      if (!visible.size) {
        board = semsig.board(map, "overlayPane", paint(map));
        stopAnswering = semsig.answers(map, 0, answer(map));
      }
      visible.add(number);
      board.redraw();
    };
    layer.onRemove = () => {
      visible.delete(number);
      board.redraw();
      if (!visible.size) {
        stopAnswering();
        board.remove();
      }
    };
    return layer;
  };
  semsig.finders.push((words, limit) => {
    if (data === null) return [];
    const titles = semsig.matches(classes.map(({title}) => semsig.plain(title)), words, limit);
    const byTitle = titles.map(({rank, at: number}) => ({
      rank: rank - 0.5,  // before the objects of this class
      name: classes[number].title,
      hint: `all ${(classes[number].end - classes[number].start).toLocaleString("en")}`,
      show: (map) => {
        map.addLayer(layers[number]);
        const {start, end, boxes} = classes[number];
        const {origin, quantum} = about;
        const edge = (part, pick) => {
          let value = boxes[part];
          for (let at = part; at < boxes.length; at += 4) value = pick(value, boxes[at]);
          return value * quantum;
        };
        map.fitBounds(L.latLngBounds([[0, 1, Math.min], [2, 3, Math.max]].map(
          ([x, y, pick]) => L.CRS.EPSG3857.unproject(L.point(
            origin[0] + edge(x, pick), origin[1] + edge(y, pick))))), {maxZoom: 18});
        if (end - start === 1) showObject(map, start);
      },
    }));
    const byId = semsig.matches(data.names, words, limit).map(({rank, at: object}) => ({
      rank,
      name: data["text.name"]?.[object] || data["text.brand"]?.[object] || data.ids[object],
      hint: `${classes[classOf(object)].title}, ${sources[data.source[object]]}`,
      show: (map) => {
        semsig.reveal(map, layers[classOf(object)], placeOf(object));
        showObject(map, object);
      },
    }));
    return [...byTitle, ...byId];
  });
  layers = classes.map((_, number) => layerOf(number));
  semsig.layerSets[key] = layers;
};
semsig.classLayer = (key, number) => semsig.layerSets[key][number];
