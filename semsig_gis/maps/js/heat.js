// Not one point laid over the other, which would show where most queries were drawn, and change
// with every zoom.
semsig.heat = (packed, {colours, ...about}) => {
  const step = 6;  // pixels of the screen to one of the field
  const radius = 28 / step;
  const shades = colours.map((colour) => [1, 3, 5].map((at) => parseInt(colour.substr(at, 2), 16)));
  let data = null;
  const paint = (map) => (ctx, min, max) => {
    const [width, height] = [max.x - min.x, max.y - min.y].map((size) => Math.ceil(size / step));
    if (data === null || !width || !height) return;
    const weights = new Float32Array(width * height);
    const sums = new Float32Array(width * height);
    const {scale, left, top} = semsig.frame(map, about);
    for (let one = 0; one < data.x.length; one += 1) {
      // In the field, where the middle of its first pixel is at 0.
      const x = (data.x[one] * scale + left - min.x) / step - 0.5;
      const y = (top - data.y[one] * scale - min.y) / step - 0.5;
      const [low, high] = [Math.max(0, Math.ceil(y - radius)), Math.min(height - 1, y + radius)];
      const [first, last] = [Math.max(0, Math.ceil(x - radius)), Math.min(width - 1, x + radius)];
      for (let row = low; row <= high; row += 1) {
        for (let column = first; column <= last; column += 1) {
          const near = 1 - ((row - y) ** 2 + (column - x) ** 2) / radius ** 2;
          if (near <= 0) continue;
          weights[row * width + column] += near * near;
          sums[row * width + column] += near * near * data.error[one];
        }
      }
    }
    const field = document.createElement("canvas");
    [field.width, field.height] = [width, height];
    const image = new ImageData(width, height);
    for (let at = 0; at < weights.length; at += 1) {
      if (weights[at] === 0) continue;
      image.data.set(shades[Math.round(sums[at] / weights[at])], 4 * at);
      image.data[4 * at + 3] = 255 * Math.min(1, 2 * weights[at]);
    }
    field.getContext("2d").putImageData(image, 0, 0);
    ctx.drawImage(field, min.x, min.y, width * step, height * step);
  };
  const layer = semsig.boardLayer("overlayPane", "semsig-heat", paint);
  semsig.arrays(packed).then((arrays) => {
    data = arrays;
    layer.redraw();
  });
  return layer;
};
