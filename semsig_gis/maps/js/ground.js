// Streets and buildings, on the images of cells and below all else.
semsig.ground = (packed, about) => {
  const chunk = 64;
  const kinds = {};
  let layer = null;
  for (const [kind, arrays] of Object.entries(packed)) {
    semsig.arrays(arrays).then((data) => {
      const firsts = new Int32Array(data.rings.length + 1);  // point of each shape
      for (let shape = 0; shape < data.rings.length; shape += 1) {
        firsts[shape + 1] = data.ends[data.rings[shape] - 1];
      }
      const starts = [];
      for (let at = 0; at < data.rings.length; at += chunk) starts.push(firsts[at]);
      starts.push(firsts[data.rings.length]);
      data.shapes = semsig.blocks(data.x, data.y, firsts);
      data.boxes = semsig.blocks(data.x, data.y, starts);
      kinds[kind] = data;
      layer.redraw();
    });
  }
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
