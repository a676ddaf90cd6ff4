// Streets and buildings, above the images of cells and below all other layers.
semsig.ground = (packed, about) => {
  const chunk = 64;
  const kinds = {};
  let layer = null;
  // Adds the streets to the search; returns a function that shows the street of a name.
  const nameStreets = (data) => {
    const plain = data.names.map(semsig.plain);
    const placeOf = (at) => L.CRS.EPSG3857.unproject(L.point(
      about.origin[0] + data.x[at] * about.quantum, about.origin[1] + data.y[at] * about.quantum));
    const linesOf = (street) => {
      const lines = [];
      data.called.forEach((name, shape) => {
        if (name !== street) return;
        const line = [];
        for (let at = data.firsts[shape]; at < data.firsts[shape + 1]; at += 1) {
          line.push(placeOf(at));
        }
        lines.push(line);
      });
      return lines;
    };
    const show = (map, street) => {
      const lines = linesOf(street);
      const bounds = L.latLngBounds(lines.flat());
      const longest = lines.reduce((best, line) => (line.length > best.length ? line : best));
      const place = longest[longest.length >> 1];
      map.fitBounds(bounds, {maxZoom: 17, animate: false});
      const at = [place.lat, place.lng];
      const area = map.semsigArea;
      const facts = semsig.whereabouts(area, at, area && semsig.xy(area, at));
      const box = semsig.details(data.names[street], facts.map((fact) => fact[0]),
        facts.map((fact) => fact[1]), {});
      semsig.show(map, box, place, {
        corners: [bounds.getSouthWest(), bounds.getNorthEast()],
        key: `street:${data.names[street]}`,
        drawn: L.polyline(lines, {
          pane: "shadowPane", interactive: false, color: semsig.highlight, weight: 6,
          opacity: 0.7}),
      });
    };
    semsig.finders.push((words, limit) => semsig.matches(plain, words, limit).map(
      ({rank, at}) => ({
        rank, name: data.names[at], hint: "street", show: (map) => show(map, at)})));
    return (map, name) => {
      const at = data.names.indexOf(name);
      if (at >= 0) show(map, at);
    };
  };
  for (const [kind, arrays] of Object.entries(packed)) {
    const ready = semsig.arrays(arrays).then((data) => {
      const firsts = new Int32Array(data.rings.length + 1);  // point of each shape
      for (let shape = 0; shape < data.rings.length; shape += 1) {
        firsts[shape + 1] = data.ends[data.rings[shape] - 1];
      }
      const starts = [];
      for (let at = 0; at < data.rings.length; at += chunk) starts.push(firsts[at]);
      starts.push(firsts[data.rings.length]);
      data.shapes = semsig.blocks(data.x, data.y, firsts);
      data.boxes = semsig.blocks(data.x, data.y, starts);
      data.firsts = firsts;
      kinds[kind] = data;
      layer.redraw();
      return data;
    });
    if (!arrays.names) continue;
    const streets = ready.then(nameStreets);
    semsig.addOpener("street", (map, name) => {
      streets.then((showStreet) => showStreet(map, name));
      return true;
    });
  }
  // Draws lines or polygons that are in view; blocks of shapes out of view are skipped as a whole.
  const draw = (ctx, data, frame, min, max, closed) => {
    const {scale, left, top} = frame;
    const outside = (boxes, at) => boxes[at + 2] * scale + left < min.x
      || boxes[at] * scale + left > max.x || top - boxes[at + 1] * scale < min.y
      || top - boxes[at + 3] * scale > max.y;
    for (let block = 0; 4 * block < data.boxes.length; block += 1) {
      if (outside(data.boxes, 4 * block)) continue;
      ctx.beginPath();
      for (let shape = chunk * block; shape < Math.min(chunk * (block + 1), data.rings.length);
        shape += 1) {
        const box = 4 * shape;
        if (outside(data.shapes, box)) continue;
        const wide = (data.shapes[box + 2] - data.shapes[box]) * scale;
        const high = (data.shapes[box + 3] - data.shapes[box + 1]) * scale;
        // Tiny buildings become rectangles, points closer than a pixel are skipped.
        if (closed && wide < 2 && high < 2) {
          ctx.rect(data.shapes[box] * scale + left, top - data.shapes[box + 3] * scale,
            Math.max(wide, 0.6), Math.max(high, 0.6));
          continue;
        }
        for (let ring = shape ? data.rings[shape - 1] : 0; ring < data.rings[shape]; ring += 1) {
          const [first, last] = [ring ? data.ends[ring - 1] : 0, data.ends[ring] - 1];
          let [fromX, fromY] = [NaN, NaN];
          for (let at = first; at <= last; at += 1) {
            const x = data.x[at] * scale + left;
            const y = top - data.y[at] * scale;
            if (at === first) ctx.moveTo(x, y);
            else if (at < last && Math.abs(x - fromX) + Math.abs(y - fromY) < 1) continue;
            else ctx.lineTo(x, y);
            [fromX, fromY] = [x, y];
          }
          if (closed) ctx.closePath();
        }
      }
      if (closed) ctx.fill(); else ctx.stroke();
    }
  };
  const paint = (map) => (ctx, min, max) => {
    const frame = semsig.frame(map, about);
    const dark = semsig.isDark(map);
    ctx.lineWidth = Math.max(0.7, about.width * frame.scale / about.quantum);
    ctx.lineCap = ctx.lineJoin = "round";
    ctx.strokeStyle = dark ? "#3b4047" : "#cfd3d8";
    ctx.fillStyle = dark ? "#272b30" : "#e4ded3";
    if (kinds.streets) draw(ctx, kinds.streets, frame, min, max, false);
    if (kinds.buildings) draw(ctx, kinds.buildings, frame, min, max, true);
  };
  layer = semsig.boardLayer("tilePane", "semsig-ground", paint);
  return layer;
};
