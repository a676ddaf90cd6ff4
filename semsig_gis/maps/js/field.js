// What became of the queries around every place, as colours; hatched where too few speak.
semsig.field = (packed, {box, width, height, breaks, colours, enough}) => {
  const step = 2;  // pixels of the screen to one of the field
  const paints = colours.map((colour) =>
    Number.parseInt(`ff${colour.slice(5)}${colour.slice(3, 5)}${colour.slice(1, 3)}`, 16));
  const hatch = document.createElement("canvas");
  hatch.width = hatch.height = 8;
  const lines = hatch.getContext("2d");
  lines.lineWidth = 3;
  for (const shift of [-8, 0, 8]) {
    lines.moveTo(shift - 2, 10);
    lines.lineTo(shift + 10, -2);
  }
  lines.stroke();
  let data = null;
  // Between the four pixels around, of which 0 is none.
  const between = (values, x, y) => {
    const [column, row] = [Math.floor(x), Math.floor(y)];
    let [sum, told] = [0, 0];
    for (let corner = 0; corner < 4; corner += 1) {
      const [across, down] = [column + (corner & 1), row + (corner >> 1)];
      if (across < 0 || across >= width || down < 0 || down >= height) continue;
      const value = values[down * width + across];
      if (!value) continue;
      const weight = Math.abs(1 - (corner & 1) - x + column) * Math.abs(1 - (corner >> 1) - y + row);
      sum += weight * value;
      told += weight;
    }
    return told < 0.5 ? 0 : sum / told;
  };
  const paint = (map) => (ctx, min, max) => {
    if (data === null) return;
    // To pixels of the field, of which the middle of the first, in the north-west, is at 0.
    const {scale, left, top} = semsig.frame(map, {origin: [box[0], box[3]], quantum: 1});
    const [wide, high] = [(box[2] - box[0]) / width, (box[3] - box[1]) / height];
    const [from, to] = [L.point(left, top), L.point(
      left + (box[2] - box[0]) * scale, top + (box[3] - box[1]) * scale)];
    const west = Math.floor(Math.max(min.x, from.x) / step);
    const north = Math.floor(Math.max(min.y, from.y) / step);
    const size = [Math.ceil(Math.min(max.x, to.x) / step) - west,
      Math.ceil(Math.min(max.y, to.y) / step) - north];
    if (size[0] <= 0 || size[1] <= 0) return;
    const layers = [false, true].map(() => new ImageData(...size));
    const [sure, unsure] = layers.map((image) => new Uint32Array(image.data.buffer));
    for (let down = 0; down < size[1]; down += 1) {
      const y = ((north + down + 0.5) * step - top) / scale / high - 0.5;
      for (let right = 0; right < size[0]; right += 1) {
        const x = ((west + right + 0.5) * step - left) / scale / wide - 0.5;
        const value = between(data.values, x, y);
        if (!value) continue;
        let colour = paints.length - 1;
        while (value < breaks[colour]) colour -= 1;
        const told = between(data.speaking, x, y) >= enough ? sure : unsure;
        told[down * size[0] + right] = paints[colour];
      }
    }
    const draw = (image) => {
      const picture = document.createElement("canvas");
      [picture.width, picture.height] = size;
      picture.getContext("2d").putImageData(image, 0, 0);
      ctx.drawImage(picture, west * step, north * step, size[0] * step, size[1] * step);
    };
    ctx.imageSmoothingEnabled = false;
    draw(layers[1]);
    ctx.globalCompositeOperation = "destination-out";
    ctx.fillStyle = ctx.createPattern(hatch, "repeat");
    ctx.fillRect(west * step, north * step, size[0] * step, size[1] * step);
    ctx.globalCompositeOperation = "source-over";
    draw(layers[0]);
  };
  const layer = semsig.boardLayer("tilePane", "semsig-field", paint);
  semsig.arrays(packed).then((arrays) => {
    data = arrays;
    layer.redraw();
  });
  return layer;
};
// A sign of a shape, given as a path around (0, 0) for a circle of radius 1.
semsig.Sign = L.CircleMarker.extend({
  _updateBounds() {
    const out = 1.25 * this._radius + this._clickTolerance() + 1;  // corners, and their outline
    this._pxBounds = L.bounds(this._point.subtract([out, out]), this._point.add([out, out]));
  },
  _updatePath() {
    const {x, y} = this._point;
    const {outline, fillColor, fillOpacity, color, weight} = this.options;
    const size = this._radius;
    const ctx = this._renderer._ctx;
    if (!ctx) {
      this._renderer._setPath(this, outline);
      this._path.setAttribute("transform", `translate(${x},${y}) scale(${size})`);
      this._path.setAttribute("vector-effect", "non-scaling-stroke");
      return;
    }
    if (!this._renderer._drawing || this._empty()) return;
    ctx.save();
    ctx.translate(x, y);
    ctx.scale(size, size);
    ctx.globalAlpha = fillOpacity;
    ctx.fillStyle = fillColor;
    ctx.fill(new Path2D(outline));
    ctx.globalAlpha = 1;
    ctx.strokeStyle = color;
    ctx.lineWidth = weight / size;
    ctx.stroke(new Path2D(outline));
    ctx.restore();
  },
});
