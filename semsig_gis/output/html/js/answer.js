// What was said and what is there, at a candidate of an answer: rays, signs and names on a canvas,
// and both in the panel. A ray has the ends of its line, its sign, its verdict, and the class and a
// text of what was `said` and of what is `there`, each or null.
semsig.answerObjects = (about, signs) => {
  const {rays, rank, place} = about;
  const notes = {missed: "not said", false: "not there", misnamed: "of another class"};
  const signOf = ({symbol, title}) => signs.classes[symbol] || {...semsig.anySign, title};
  const nameOf = ({said, there, verdict}) => {
    const {title} = signOf(there || said);
    return verdict === "matched" ? title : `${title} (${notes[verdict]})`;
  };
  let layer = null;
  let map = null;
  let lit = -1;
  let stopAnswering = null;
  let drawn = [];  // the place and radius of each sign in pixels
  const sizes = [[16.5, 4], [17.5, 7], [18.5, 9], [Infinity, 12]];
  const halo = (ctx, text, x, y, dark) => {
    ctx.lineJoin = "round";
    ctx.lineWidth = 4;
    ctx.strokeStyle = dark ? "#131518" : "#fcfcfa";
    ctx.strokeText(text, x, y);
    ctx.fillStyle = dark ? "#e9e9e6" : "#222";
    ctx.fillText(text, x, y);
  };
  const drawSign = (ctx, {said, there, verdict}, {x, y, size}, dark, isLit) => {
    const sign = signOf(there || said);
    const hollow = verdict === "missed" || verdict === "false";
    const ink = dark ? "#e9e9e6" : "#222";
    ctx.save();
    ctx.translate(x, y);
    ctx.scale(size, size);
    const disc = new Path2D(semsig.disc);
    ctx.fillStyle = hollow ? (dark ? "#131518" : "#fcfcfa") : sign.colour;
    ctx.fill(disc);
    if (size >= 7 && sign.pictogram) {
      semsig.paintPictogram(ctx, sign.pictogram, hollow ? ink : sign.ink);
    }
    const {outline, colour} = signs.verdicts[verdict];
    const frame = new Path2D(outline);
    ctx.scale(1.25, 1.25);
    for (const [stroke, width] of [[isLit ? semsig.highlight : ink, 5], [colour, 3]]) {
      ctx.strokeStyle = stroke;
      ctx.lineWidth = (isLit ? 2 : 1) * width / size / 1.25;
      ctx.setLineDash(verdict === "missed" ? [0.35, 0.25] : []);
      ctx.stroke(frame);
    }
    ctx.restore();
  };
  const paint = (onMap) => (ctx) => {
    const dark = semsig.isDark(onMap);
    const size = sizes.find(([below]) => onMap.getZoom() < below)[1];
    const at = (latlng) => onMap.latLngToLayerPoint(latlng);
    const middle = at(place);
    drawn = rays.map(({sign}) => ({...at(sign), size: 1.25 * size}));
    rays.forEach(({to, verdict, said}, index) => {
      // A narrow triangle between the direction that was said and that of the object.
      const {x, y} = drawn[index];
      const end = at(to);
      ctx.strokeStyle = ctx.fillStyle = verdict === "missed"
        ? (dark ? "#bcc0c5" : "#808080") : signs.verdicts[verdict].colour;
      ctx.lineWidth = index === lit ? 4 : verdict === "missed" ? 1.2 : 2;
      ctx.setLineDash({missed: [3, 5], false: [3, 5], misnamed: [9, 4]}[verdict] || []);
      ctx.beginPath();
      ctx.moveTo(middle.x, middle.y);
      ctx.lineTo(x, y);
      ctx.stroke();
      if (!said) return;
      ctx.globalAlpha = 0.25;
      ctx.lineTo(end.x, end.y);
      ctx.fill();
      ctx.globalAlpha = 1;
    });
    ctx.setLineDash([]);
    const order = [...rays.keys()].reverse();
    for (const index of order) {
      drawSign(ctx, rays[index], {...drawn[index], size}, dark, index === lit);
    }
    if (size < 9 && lit < 0) return;
    // Names next to the signs, where they do not cover each other.
    ctx.font = "600 12px system-ui, sans-serif";
    ctx.textBaseline = "middle";
    ctx.textAlign = "left";
    const taken = drawn.map(({x, y, size: out}) => [x - out, y - out, x + out, y + out]);
    taken.push([middle.x - 12, middle.y - 12, middle.x + 12, middle.y + 12]);
    // Where the panel leaves room.
    const {panel} = onMap.semsigPanel;
    const low = onMap.containerPointToLayerPoint([0, 0]);
    const high = low.add(onMap.getSize()).subtract(
      semsig.isSheet(onMap, panel) ? [0, panel.offsetHeight] : [panel.offsetWidth, 0]);
    const names = lit < 0 ? [...rays.keys()] : [lit, ...rays.keys()];
    const done = new Set();
    for (const index of names) {
      if (done.has(index) || (size < 9 && index !== lit)) continue;
      const {x, y, size: out} = drawn[index];
      const text = nameOf(rays[index]);
      const wide = ctx.measureText(text).width;
      const sides = [[x + out + 4, y], [x - out - 4 - wide, y],
        [x - wide / 2, y + out + 10], [x - wide / 2, y - out - 10]];
      if (x < middle.x) sides.unshift(sides.splice(1, 1)[0]);
      const free = sides.find(([left, middleY]) => left > low.x && left + wide < high.x
        && taken.every(([west, north, east, south]) => left > east || left + wide < west
          || middleY - 7 > south || middleY + 7 < north));
      const spot = free || (index === lit ? sides[0] : null);
      if (!spot) continue;
      halo(ctx, text, ...spot, dark);
      done.add(index);
      taken.push([spot[0], spot[1] - 7, spot[0] + wide, spot[1] + 7]);
    }
  };
  const light = (index) => {
    if (index === lit) return;
    lit = index;
    layer.redraw();
    if (!map) return;
    for (const row of map.getContainer().querySelectorAll(`[data-answer="${rank}"] tbody tr`)) {
      row.classList.toggle("lit", Number(row.dataset.at) === lit);
    }
  };
  // One side of a row: the sign of a class, its name and more.
  const side = (row, part, note, verdict, more) => {
    const cell = L.DomUtil.create("td", "", row);
    if (!part) {
      L.DomUtil.create("em", "", cell).textContent = note;
      return;
    }
    const drawing = semsig.svg(cell, "svg", {
      viewBox: "-1.6 -1.6 3.2 3.2", class: verdict, "aria-hidden": "true"});
    semsig.drawFrame(drawing, signs.verdicts[verdict]);
    semsig.drawSign(drawing, signOf(part), part.symbol);
    cell.append(signOf(part).title);
    semsig.text(cell, "small", part.text);
    if (more) semsig.text(cell, "em", more);
  };
  const show = () => {
    const box = L.DomUtil.create("div", "semsig-details semsig-answer");
    box.dataset.answer = rank;
    semsig.text(box, "h2", about.title);
    about.lines.forEach((line, at) => {
      semsig.text(box, "p", line).className = about.where && at === 0 ? "semsig-where" : "";
    });
    box.append(semsig.links(map, L.latLng(about.best)));
    const table = L.DomUtil.create("table", "semsig-said", box);
    const head = L.DomUtil.create("tr", "", L.DomUtil.create("thead", "", table));
    for (const text of ["You said", "Is there"]) {
      Object.assign(semsig.text(head, "th", text), {scope: "col"});
    }
    const body = L.DomUtil.create("tbody", "", table);
    rays.forEach(({said, there, verdict}, index) => {
      const row = L.DomUtil.create("tr", verdict, body);
      row.dataset.at = index;
      side(row, said, notes.missed, verdict);
      side(row, there, notes.false, verdict, verdict === "misnamed" ? notes.misnamed : "");
      L.DomEvent.on(row, "mouseenter click", () => light(index));
      L.DomEvent.on(row, "mouseleave", () => light(-1));
    });
    for (const [said, words] of about.more) {
      const row = L.DomUtil.create("tr", "", body);
      semsig.text(row, "td", said);
      semsig.text(row, "td", words);
    }
    const facts = L.DomUtil.create("details", "", box);
    semsig.text(facts, "summary", "In numbers");
    const numbers = L.DomUtil.create("table", "", facts);
    for (const [label, value] of about.facts) {
      const line = L.DomUtil.create("tr", "", numbers);
      semsig.text(line, "th", label);
      semsig.text(line, "td", value);
    }
    semsig.show(map, box, about.best, {
      key: `answer:${rank}`, corners: rays.map(({sign}) => sign)});
  };
  const indexAt = (point) => {
    let [best, least] = [-1, Infinity];
    drawn.forEach(({x, y, size}, index) => {
      const away = Math.hypot(x - point.x, y - point.y);
      if (away <= Math.max(size, 10) && away < least) [best, least] = [index, away];
    });
    return best;
  };
  layer = semsig.boardLayer("markerPane", "semsig-objects", paint);
  const {onAdd, onRemove} = layer;
  const hover = ({latlng}) => light(indexAt(map.latLngToLayerPoint(latlng)));
  layer.onAdd = (onMap) => {
    map = onMap;
    onAdd(map);
    stopAnswering = semsig.answers(map, 0, ({latlng}) => {
      const index = indexAt(map.latLngToLayerPoint(latlng));
      if (index < 0) return false;
      show();
      lit = -1;
      light(index);
      const row = map.getContainer().querySelector(`[data-answer="${rank}"] tr.lit`);
      row?.scrollIntoView({block: "nearest"});
      return true;
    });
    map.on("mousemove", hover);
  };
  layer.onRemove = () => {
    stopAnswering();
    map.off("mousemove", hover);
    onRemove();
  };
  semsig.addOpener("answer", (onMap, key) => {
    if (key !== String(rank)) return false;
    map = onMap;
    show();
    return true;
  });
  return layer;
};
// The sign of the best place, which opens the panel of the answer.
semsig.answerMark = (place, outline, colour) => {
  const mark = new semsig.Sign(place, {
    pane: "markerPane", radius: 9, color: "#222", weight: 1.5, fillColor: colour, fillOpacity: 1,
    outline,
  });
  mark.on("click", (event) => {
    L.DomEvent.stop(event);
    semsig.openers.answer(mark._map, "1");
  });
  const look = () => mark.setStyle({color: semsig.outline(mark._map)});
  mark.on("add", () => {
    mark._map.on("semsig-colours", look);
    look();
  });
  mark.on("remove", () => mark._map.off("semsig-colours", look));
  return mark;
};
