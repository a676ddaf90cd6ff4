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
  // Names along their streets, where they do not cover each other.
  const paintNames = (map) => (ctx, min, max) => {
    const zoom = map.getZoom();
    const data = kinds.streets;
    if (!data?.names || zoom < 15.5) return;
    const {scale, left, top} = semsig.frame(map, about);
    const dark = semsig.isDark(map);
    ctx.font = `${zoom < 17.5 ? 11 : 13}px system-ui, sans-serif`;
    [ctx.textAlign, ctx.textBaseline, ctx.lineJoin, ctx.lineWidth] = [
      "center", "middle", "round", 3];
    [ctx.strokeStyle, ctx.fillStyle] = dark ? ["#131518", "#bcc0c5"] : ["#fcfcfa", "#4a4f55"];
    const taken = [];
    data.called.forEach((name, shape) => {
      const [west, south, east, north] = data.shapes.subarray(4 * shape, 4 * shape + 4);
      if (name < 0 || east * scale + left < min.x || west * scale + left > max.x
        || top - south * scale < min.y || top - north * scale > max.y) return;
      if ((east - west + north - south) * scale < 30) return;  // no room for a name
      const [from, to] = [data.firsts[shape], data.firsts[shape + 1]];
      const text = data.names[name];
      const wide = ctx.measureText(text).width;
      const points = [];
      let length = 0;
      for (let at = from; at < to; at += 1) {
        const [x, y] = [data.x[at] * scale + left, top - data.y[at] * scale];
        const before = points.at(-1);
        if (before) length += Math.hypot(x - before.x, y - before.y);
        points.push({x, y, length});
      }
      const along = (way) => {
        const at = Math.max(1, points.findIndex((point) => point.length >= way));
        const [first, second] = [points[at - 1], points[at]];
        const share = (way - first.length) / (second.length - first.length || 1);
        return [first.x + share * (second.x - first.x), first.y + share * (second.y - first.y)];
      };
      // Every 400 pixels, where the street is straight enough.
      const count = Math.floor((length - wide) / 400) + 1;
      for (let number = 0; length > wide + 8 && number < count; number += 1) {
        const middle = length * (number + 0.5) / count;
        const [[x, y], [endX, endY]] = [along(middle - wide / 2), along(middle + wide / 2)];
        const [midX, midY] = [(x + endX) / 2, (y + endY) / 2];
        const inside = midX > min.x && midX < max.x && midY > min.y && midY < max.y;
        if (!inside || Math.hypot(endX - x, endY - y) < 0.97 * wide) continue;
        const spots = [-0.5, -0.25, 0, 0.25, 0.5].map(
          (part) => [midX + part * (endX - x), midY + part * (endY - y)]);
        const near = Math.max(16, wide / 4);
        if (taken.some(([u, v, other, called]) => spots.some(([a, b]) =>
          Math.hypot(a - u, b - v) < (called === name ? 250 : (near + other) / 2)))) continue;
        taken.push(...spots.map((spot) => [...spot, near, name]));
        const turn = Math.atan2(endY - y, endX - x);
        ctx.save();
        ctx.translate(midX, midY);
        ctx.rotate(Math.abs(turn) > Math.PI / 2 ? turn + Math.PI : turn);
        ctx.strokeText(text, 0, 0);
        ctx.fillText(text, 0, 0);
        ctx.restore();
      }
    });
  };
  layer = semsig.boardLayer("tilePane", "semsig-ground", paint);
  const names = semsig.boardLayer("tilePane", "semsig-names", paintNames);
  const {redraw} = layer;
  layer.redraw = () => {
    redraw();
    names.redraw();
  };
  return semsig.together(layer, names);
};
