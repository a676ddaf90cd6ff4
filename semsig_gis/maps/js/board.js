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
// A canvas that one function paints, at once and after every move.
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
// A layer that is such a canvas.
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
// Boxes around so many points at a time, to leave out what is not in view.
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
