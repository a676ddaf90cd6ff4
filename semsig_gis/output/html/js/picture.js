// Copy the coordinates of the selected place, or of the middle of the map, to the clipboard.
semsig.copy = (map) => {
  const {lat, lng} = map.semsigPanel?.selection?.place || map.getCenter();
  const text = `${lat.toFixed(6)}, ${lng.toFixed(6)}`;
  return navigator.clipboard.writeText(text).then(
    () => semsig.showStatus(map, `Copied: ${text}`),
    () => semsig.showStatus(map, `Copy by hand: ${text}`));
};
// Shows a message for five seconds; screen readers read it.
semsig.showStatus = (map, text) => {
  const box = map.getContainer().querySelector(".semsig-status");
  box.textContent = text;
  clearTimeout(map.semsigStatusTimer);
  map.semsigStatusTimer = setTimeout(() => box.replaceChildren(), 5000);
};
// The boxes that a picture or a printed page includes: title, legend, scale, credits.
semsig.about = ".semsig-title, .semsig-legend, .leaflet-control-scale, .leaflet-control-attribution";
// Draws these boxes on a canvas as the page shows them, through an SVG image of their HTML.
semsig.drawBoxes = async (ctx, map) => {
  const container = map.getContainer();
  const frame = container.getBoundingClientRect();
  const sheet = document.createElement("div");
  sheet.className = container.className;
  sheet.style.cssText = `position:relative;background:none;width:${frame.width}px;height:${frame.height}px`;
  for (const style of document.querySelectorAll("style")) sheet.append(style.cloneNode(true));
  for (const box of container.querySelectorAll(semsig.about)) {
    const {left, top, width, height} = box.getBoundingClientRect();
    if (!width) continue;
    const copy = box.cloneNode(true);
    copy.style.cssText += `;position:absolute;margin:0;transform:none;left:${left - frame.left}px;`
      + `top:${top - frame.top}px;width:${width + 1}px;height:${height}px;max-width:none;right:auto`;
    sheet.append(copy);
  }
  const [drawing, inside] = ["svg", "foreignObject"].map((name) => {
    const part = L.SVG.create(name);
    part.setAttribute("width", frame.width);
    part.setAttribute("height", frame.height);
    return part;
  });
  inside.append(sheet);
  drawing.append(inside);
  const image = new Image();
  image.src = `data:image/svg+xml,${encodeURIComponent(
    new XMLSerializer().serializeToString(drawing))}`;
  await image.decode();
  ctx.drawImage(image, 0, 0);
};
// The visible map with these boxes as a canvas, without online tiles, which a page may not read.
semsig.picture = async (map) => {
  const container = map.getContainer();
  const frame = container.getBoundingClientRect();
  const dots = window.devicePixelRatio;
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [frame.width * dots, frame.height * dots];
  const ctx = canvas.getContext("2d");
  ctx.scale(dots, dots);
  ctx.fillStyle = getComputedStyle(container).backgroundColor;
  ctx.fillRect(0, 0, frame.width, frame.height);
  const panes = [...container.querySelectorAll(".leaflet-map-pane > .leaflet-pane")]
    .sort((first, second) => getComputedStyle(first).zIndex - getComputedStyle(second).zIndex);
  for (const part of panes.flatMap((pane) => [...pane.querySelectorAll(
    "img:not(.leaflet-tile), canvas, .semsig-number")])) {
    const {left, top, width, height} = part.getBoundingClientRect();
    if (!width || !height) continue;
    const look = getComputedStyle(part);
    const blend = look.mixBlendMode;
    ctx.save();
    ctx.globalAlpha = look.opacity;
    ctx.filter = look.filter;
    ctx.globalCompositeOperation = blend === "normal" ? "source-over" : blend;
    ctx.imageSmoothingEnabled = look.imageRendering !== "pixelated";
    const [x, y] = [left - frame.left, top - frame.top];
    if (part.matches(".semsig-number")) {
      ctx.font = `bold 11px ${look.fontFamily}`;
      ctx.fillStyle = look.color;
      [ctx.textAlign, ctx.textBaseline] = ["center", "middle"];
      ctx.fillText(part.textContent, x + width / 2, y + height / 2);
    } else ctx.drawImage(part, x, y, width, height);
    ctx.restore();
  }
  await semsig.drawBoxes(ctx, map);
  return canvas;
};
semsig.savePicture = async (map) => {
  const canvas = await semsig.picture(map);
  const blob = await new Promise((done) => { canvas.toBlob(done); });
  const name = `${(document.title.match(/[\p{L}\p{N}]+/gu) || ["map"]).join("-")}.png`;
  semsig.download(name, blob);
  semsig.showStatus(map, `Saved: ${name}`);
};
// Print the map with light colours in the size of the paper.
semsig.print = async (map) => {
  const container = map.getContainer();
  const dark = semsig.isDark(map);
  const legends = [...container.querySelectorAll(".semsig-legend")];
  const open = legends.map((legend) => legend.open);
  const set = (is) => {
    container.classList.toggle("semsig-paper", is);
    container.classList.toggle("semsig-dark", dark && !is);
    legends.forEach((legend, at) => { legend.open = is ? at === 0 : open[at]; });
    map.fire("semsig-colours");
    map.invalidateSize({animate: false});
  };
  const {lat, lng} = map.getCenter();
  set(true);
  map.setView([lat, lng], map.getZoom(), {animate: false});
  for (let frame = 0; frame < 2; frame += 1) await new Promise(requestAnimationFrame);
  window.print();
  set(false);
  map.setView([lat, lng], map.getZoom(), {animate: false});
};
// Buttons next to that of light and dark colours.
semsig.pictureButtons = (map) => {
  for (const [name, sign, title, act] of [
    ["semsig-save", "M10 3v9M6 8l4 4 4-4M3 13v4h14v-4", "Save this view as a picture",
      semsig.savePicture],
    ["semsig-print", "M6 7V3h8v4M6 14H3V7h14v7h-3M6 11h8v6H6z", "Print this view", semsig.print],
  ]) semsig.mapButton(map.semsigBar, name, "", title, () => act(map)).append(semsig.icon(sign));
};
