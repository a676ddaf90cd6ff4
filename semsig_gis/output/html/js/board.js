// From packed numbers to pixels of a layer and back: `x * scale + left`.
semsig.frame = (map, {origin, quantum}, zoom = map.getZoom()) => {
  const across = 2 * Math.PI * 6378137;
  const pixels = 256 * 2 ** zoom / across;
  const corner = map.getPixelOrigin();
  return {
    scale: pixels * quantum,
    left: (origin[0] + across / 2) * pixels - corner.x,
    top: (across / 2 - origin[1]) * pixels - corner.y,
  };
};
// A canvas that a function paints now and after every move of the map.
semsig.board = (map, pane, paint) => {
  const board = L.canvas({pane, padding: 0.2});
  board._draw = () => {
    const {min, max} = board._bounds;
    paint(board._ctx, min, max);
  };
  board.addTo(map);
  board._container.classList.add("semsig-board");
  let waiting = null;
  const redraw = () => {
    waiting = waiting || L.Util.requestAnimFrame(() => {
      waiting = null;
      if (board._ctx) board._redraw();
    });
  };
  map.on("semsig-colours", redraw);
  board.on("remove", () => map.off("semsig-colours", redraw));
  return {redraw, remove: () => board.remove(), canvas: board._container};
};
// A layer with such a canvas.
semsig.boardLayer = (pane, name, paint) => {
  const layer = new L.Layer();
  let board = null;
  layer.onAdd = (map) => {
    board = semsig.board(map, pane, paint(map));
    board.canvas.classList.add(name);
  };
  layer.onRemove = () => {
    board.remove();
    board = null;
  };
  layer.redraw = () => { if (board) board.redraw(); };
  return layer;
};
// The pixels of a sign that are not transparent: offsets to the right and down, and colours.
semsig.sprite = (radius, draw) => {
  const half = Math.ceil(radius);
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 2 * half;
  const ctx = canvas.getContext("2d");
  ctx.translate(half, half);
  draw(ctx);
  const colours = new Uint32Array(ctx.getImageData(0, 0, 2 * half, 2 * half).data.buffer);
  const solid = [...colours.keys()].filter((at) => colours[at] >>> 24 > 40);
  return {
    right: Int16Array.from(solid, (at) => at % (2 * half) - half),
    down: Int16Array.from(solid, (at) => Math.floor(at / (2 * half)) - half),
    colour: Uint32Array.from(solid, (at) => colours[at]),
  };
};
// Fills a pictogram on a disc around (0, 0) with a radius of 1.
semsig.paintPictogram = (ctx, pictogram, ink) => {
  ctx.save();
  ctx.scale(0.085, 0.085);
  ctx.translate(-8, -8);
  ctx.fillStyle = ink;
  ctx.fill(new Path2D(pictogram));
  ctx.restore();
};
// The mean of two colours.
semsig.halved = (first, second) =>
  (((first ^ second) & 0xfefefefe) >>> 1) + (first & second) >>> 0;
// Draw many signs pixel by pixel, which is much faster than drawing images on a canvas. `fill` gets
// the number of canvas pixels per screen pixel, and a function that copies a sign to a place.
semsig.stamped = (ctx, min, max, fill) => {
  const {width, height} = ctx.canvas;
  if (!width || !height) return;  // a hidden page has no size
  const image = ctx.createImageData(width, height);
  const pixels = new Uint32Array(image.data.buffer);
  const dots = width / (max.x - min.x);
  fill(dots, ({right, down, colour}, x, y) => {
    const [left, top] = [Math.round((x - min.x) * dots), Math.round((y - min.y) * dots)];
    for (let at = 0; at < colour.length; at += 1) {
      const [across, along] = [left + right[at], top + down[at]];
      if (across < 0 || across >= width || along < 0 || along >= height) continue;
      const place = along * width + across;
      const whole = colour[at] >>> 24 > 200 || !pixels[place];
      pixels[place] = whole ? colour[at] : semsig.halved(colour[at], pixels[place]);
    }
  });
  ctx.putImageData(image, 0, 0);
};
// Boxes around blocks of points, to skip blocks that are not in view.
semsig.blocks = (x, y, starts) => {
  const boxes = new Int32Array(4 * (starts.length - 1));
  for (let block = 0; block + 1 < starts.length; block += 1) {
    let [west, south, east, north] = [Infinity, Infinity, -Infinity, -Infinity];
    for (let at = starts[block]; at < starts[block + 1]; at += 1) {
      if (x[at] < west) west = x[at];
      if (x[at] > east) east = x[at];
      if (y[at] < south) south = y[at];
      if (y[at] > north) north = y[at];
    }
    boxes.set([west, south, east, north], 4 * block);
  }
  return boxes;
};
