// The share of failed queries around every place, as colours; hatched where there are few queries.
semsig.field = (packed, {box, width, height, breaks, colours, enough}) => {
  const step = 2;  // screen pixels per pixel of the field
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
  // For interpolation: the first of two neighbouring pixels, and the weight of the second.
  const crossing = (place, count) => {
    const first = Math.min(Math.max(Math.floor(place), 0), count - 2);
    return [first, Math.min(Math.max(place - first, 0), 1)];
  };
  const paint = (map) => (ctx, min, max) => {
    if (data === null) return;
    // Convert to pixels of the field; 0 is the middle of the first, north-western pixel.
    const {scale, left, top} = semsig.frame(map, {origin: [box[0], box[3]], quantum: 1});
    const [wide, high] = [(box[2] - box[0]) / width, (box[3] - box[1]) / height];
    const [from, to] = [L.point(left, top), L.point(
      left + (box[2] - box[0]) * scale, top + (box[3] - box[1]) * scale)];
    const west = Math.floor(Math.max(min.x, from.x) / step);
    const north = Math.floor(Math.max(min.y, from.y) / step);
    const size = [Math.ceil(Math.min(max.x, to.x) / step) - west,
      Math.ceil(Math.min(max.y, to.y) / step) - north];
    if (size[0] <= 0 || size[1] <= 0) return;
    const layers = [0, 1].map(() => new ImageData(...size));
    const [sure, unsure] = layers.map((image) => new Uint32Array(image.data.buffer));
    const columns = Array.from({length: size[0]}, (_, right) =>
      crossing(((west + right + 0.5) * step - left) / scale / wide - 0.5, width));
    const {values, weights: queryWeights} = data;
    for (let down = 0; down < size[1]; down += 1) {
      const [row, below] = crossing(
        ((north + down + 0.5) * step - top) / scale / high - 0.5, height);
      for (let right = 0; right < size[0]; right += 1) {
        const column = columns[right];
        const at = row * width + column[0];
        const weights = [(1 - column[1]) * (1 - below), column[1] * (1 - below),
          (1 - column[1]) * below, column[1] * below];
        let [sum, weight, queries] = [0, 0, 0];
        for (let corner = 0; corner < 4; corner += 1) {
          const pixel = at + (corner & 1) + (corner >> 1) * width;
          if (!values[pixel]) continue;  // no value here
          sum += weights[corner] * values[pixel];
          weight += weights[corner];
          queries += weights[corner] * queryWeights[pixel];
        }
        if (weight < 0.5) continue;
        let colour = paints.length - 1;
        while (sum < breaks[colour] * weight) colour -= 1;
        (queries >= enough ? sure : unsure)[down * size[0] + right] = paints[colour];
      }
    }
    const draw = (image) => {
      const picture = document.createElement("canvas");
      [picture.width, picture.height] = size;
      picture.getContext("2d").putImageData(image, 0, 0);
      ctx.drawImage(picture, west * step, north * step, size[0] * step, size[1] * step);
    };
    // Draw the uncertain part first and cut the hatching out of it, then the certain part.
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
// A circle marker with another shape: an SVG path around (0, 0), in units of the radius.
semsig.Sign = L.CircleMarker.extend({
  _updateBounds() {
    const out = 1.25 * this._radius + this._clickTolerance() + 1;  // corners and their outline
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
