semsig.svg = (parent, name, values, text) => {
  const part = L.SVG.create(name);
  for (const [key, value] of Object.entries(values)) part.setAttribute(key, value);
  if (text !== undefined) part.textContent = text;
  parent?.append(part);
  return part;
};
// Draw the sign of a class, and the frame of a verdict on an object, around (0, 0). The sign is the
// pictogram of the class on a disc or, without one, its letter on the shape of the class.
semsig.disc = "M-1,0A1,1 0 1 1 1,0A1,1 0 1 1 -1,0Z";
semsig.drawSign = (parent, {outline, colour, ink, drop, pictogram}, symbol) => {
  semsig.svg(parent, "path", {d: pictogram ? semsig.disc : outline, fill: colour, class: "sign"});
  if (pictogram) {
    semsig.svg(parent, "path", {
      d: pictogram, fill: ink, class: "picture", transform: "scale(.085)translate(-8-8)"});
    return;
  }
  semsig.svg(parent, "text", {y: drop + 0.42, "font-size": 1.2, fill: ink}, symbol);
};
semsig.drawFrame = (parent, {outline, colour}) => {
  semsig.svg(parent, "path", {d: outline, stroke: colour, class: "frame", transform: "scale(1.45)"});
};
// The sign of an unknown class.
semsig.anySign = {outline: semsig.disc, colour: "#808080",
  ink: "#ffffff", drop: 0, title: "any class"};
// A text for each object of a signature: title, bearing and, if known, distance.
semsig.entries = (types, bearings, look = {}, classes = {}) => bearings.map((degrees, at) => {
  const metres = look.metres?.[at] ?? null;
  const far = metres === null ? "" : `\u00a0${metres}\u00a0m`;
  const wide = look.extents?.[at] ? `\u00a0over\u00a0${look.extents[at]}\u00b0` : "";
  const outside = look.outside?.includes(at) ? "\u00a0(outside)" : "";
  const title = types ? (classes[types[at]] || semsig.anySign).title : null;
  return `${title ? `${title}\u00a0` : ""}${degrees}\u00b0${far}${wide}${outside}`;
});
// The distance of an object from the middle of a wheel, as a share of its radius: to scale if the
// wheel reaches to 60 m, and logarithmic if it reaches farther, so that near objects keep their room.
semsig.share = (metres, reach) =>
  (reach > 60 ? Math.log1p(metres / 10) / Math.log1p(reach / 10) : metres / reach);
// The metres of a share of the radius, the inverse.
semsig.metresAt = (share, reach) =>
  (reach > 60 ? 10 * Math.expm1(share * Math.log1p(reach / 10)) : share * reach);
semsig.lengthText = (metres) =>
  (metres < 1000 ? `${Math.round(metres)} m` : `${(metres / 1000).toFixed(1)} km`);
// Names of the verdicts, by the kind of comparison of two signatures.
semsig.comparisons = {
  query: {matched: "matched", misnamed: "misnamed", missed: "missed", false: "extra"},
  cells: {matched: "in both", misnamed: "of another class", missed: "only here",
    false: "only there"},
  dates: {matched: "still there", misnamed: "of another class", missed: "gone", false: "new"},
};
// Pairs the objects of two signatures, nearest in bearing and distance first. Returns for each
// signature a list with the `partner` (index or -1) and the `verdict` of each object; `lone` has
// the verdicts of unpaired objects, by signature.
semsig.compare = ([types, bearings, look = {}], [others, degrees, otherLook = {}], lone) => {
  const sides = [[types, bearings, look], [others, degrees, otherLook]];
  const partner = sides.map(([, angles]) => angles.map(() => -1));
  const turn = (otherLook.turn ?? 0) - (look.turn ?? 0);
  const pairs = [];
  const same = (first, second) => !types || !others || types[first] === others[second];
  bearings.forEach((angle, first) => {
    if (look.outside?.includes(first)) return;
    degrees.forEach((otherAngle, second) => {
      if (otherLook.outside?.includes(second)) return;
      const off = Math.abs(((otherAngle + turn - angle) % 360 + 540) % 360 - 180);
      const [near, far] = [look.metres?.[first] ?? null, otherLook.metres?.[second] ?? null];
      const apart = near === null || far === null ? 0 : Math.abs(near - far);
      const equal = same(first, second);
      if (off <= (equal ? 25 : 12)) pairs.push([off + apart + (equal ? 0 : 20), first, second]);
    });
  });
  for (const [, first, second] of pairs.sort((a, b) => a[0] - b[0])) {
    if (partner[0][first] >= 0 || partner[1][second] >= 0) continue;
    [partner[0][first], partner[1][second]] = [second, first];
  }
  return sides.map(([, angles, {outside}], side) => angles.map((_, at) => {
    const mate = partner[side][at];
    const [first, second] = side ? [mate, at] : [at, mate];
    const verdict = outside?.includes(at) ? "outside" : mate < 0 ? lone[side]
      : same(first, second) ? "matched" : "misnamed";
    return {partner: mate, verdict};
  }));
};
// A signature from above: north up, every object at its bearing. The look of a view has the metres
// to each object (null if unknown), the reach of the ring in metres, the degrees over which extended
// things extend, the visible sectors, and the indices of the objects outside them. What is farther
// than the reach stands outside the ring, with its distance. `comparison` has the verdict of each
// object.
semsig.wheel = (
  label, [types, bearings, look = {}], {classes = {}, verdicts = {}}, comparison = [],
) => {
  const figure = L.DomUtil.create("figure", "");
  const isFar = (index) => (look.metres?.[index] ?? 0) > look.reach;
  const room = bearings.some((_, index) => isFar(index)) ? 16 : 0;
  const drawing = semsig.svg(figure, "svg", {
    viewBox: `${-58 - room} ${-68 - room} ${116 + 2 * room} ${126 + 2 * room}`, role: "group"});
  const places = bearings.map((degrees) => degrees * Math.PI / 180);
  const at = (angle, radius) => [radius * Math.sin(angle), -radius * Math.cos(angle)];
  const entries = semsig.entries(types, bearings, look, classes).map(
    (entry) => entry.replaceAll("\u00a0", " "));
  drawing.setAttribute("aria-label", `${label}, clockwise from north: ${entries.join(", ")}`);
  for (const [from, to] of look.sectors || []) {
    const [[x, y], [endX, endY]] = [at(from * Math.PI / 180, 54), at(to * Math.PI / 180, 54)];
    const large = to - from > 180 ? 1 : 0;
    semsig.svg(drawing, "path",
      {d: `M0,0L${x},${y}A54,54 0 ${large} 1 ${endX},${endY}Z`, class: "looked"});
  }
  semsig.svg(drawing, "circle", {r: 54, class: "ring"});
  semsig.svg(drawing, "path", {d: "M0,-67L4,-56H-4Z", class: "north"});
  semsig.svg(drawing, "circle", {r: 1.5, class: "north"});
  // The more objects, the smaller their signs.
  const crowded = bearings.length > 16;
  const size = !types ? 3 : crowded ? Math.max(4.5, 24 / Math.sqrt(bearings.length)) : 6;
  // With distances the drawing is to scale; what has none stands on the rim.
  const reach = 52 - 2 * size;
  if (look.metres) {
    for (const part of [0.5, 1]) {
      semsig.svg(drawing, "circle", {r: reach * part, class: "scale"});
      semsig.svg(drawing, "text", {x: 0, y: reach * part + 6.5, "font-size": 6.8, class: "scale"},
        `${Math.round(semsig.metresAt(part, look.reach))} m`);
    }
  }
  // Signs that would hide each other in a crowd move along their bearings to the nearest free place.
  const taken = [];
  const apart = ([x, y]) => Math.min(...taken.map(([u, v]) => Math.hypot(u - x, v - y)));
  const freeRadius = (angle, wanted) => {
    const radii = [];
    for (let off = 0; off < reach; off += size / 2) radii.push(wanted - off, wanted + off);
    const inside = radii.filter((radius) => radius >= 1.5 * size && radius <= 53 - size);
    const spots = inside.map((radius) => [radius, apart(at(angle, radius))]);
    const [radius] = spots.find(([, space]) => space >= 2.1 * size)
      || spots.reduce((best, spot) => (spot[1] > best[1] ? spot : best), [wanted, -1]);
    taken.push(at(angle, radius));
    return radius;
  };
  // Landmarks in one direction stand behind each other; only one of them has its distance.
  const farRadius = (angle) => {
    let radius = 54 + size;
    while (apart(at(angle, radius)) < size && radius < 54 + 4 * size) radius += size / 2;
    taken.push(at(angle, radius));
    return radius;
  };
  const labels = [];
  const arcs = semsig.svg(drawing, "g", {});
  // Without distances, signs that would overlap move from the rim nearer to the middle.
  const circles = [];
  for (let radius = look.metres ? 54 : 52 - size; radius > size; radius -= 2.2 * size) {
    circles.push({radius, angles: []});
  }
  places.forEach((angle, index) => {
    const space = ({radius, angles}) => Math.min(7, ...angles.map((other) => {
      const turn = Math.abs(angle - other) % (2 * Math.PI);
      return Math.min(turn, 2 * Math.PI - turn);
    })) * radius;
    const metres = look.metres?.[index] ?? null;
    const scaled = metres === null ? 0 : semsig.share(metres, look.reach) * reach;
    const free = isFar(index) ? {radius: farRadius(angle), angles: []}
      : metres !== null
        ? {radius: crowded ? freeRadius(angle, scaled) : scaled, angles: []}
        : look.metres ? circles[0]
          : circles.find((circle) => space(circle) >= 2.2 * size)
            || circles.reduce((best, circle) => (space(circle) > space(best) ? circle : best));
    free.angles.push(angle);
    const verdict = comparison[index]?.verdict ?? (look.outside?.includes(index) ? "outside" : "");
    const object = semsig.svg(drawing, "g", {
      class: `object ${verdict}`, role: "img", tabindex: index ? -1 : 0,
      "aria-label": entries[index],
    });
    if (!look.metres) {
      const [[x, y], [outX, outY]] = [at(angle, free.radius + size), at(angle, 54)];
      semsig.svg(object, "line", {x1: x, y1: y, x2: outX, y2: outY, class: "ray"});
    }
    const [x, y] = at(angle, free.radius);
    const classSign = types && (classes[types[index]] || semsig.anySign);
    const half = (look.extents?.[index] ?? 0) * Math.PI / 360;
    if (half) {
      const [[fromX, fromY], [toX, toY]] = [-1, 1].map(
        (side) => at(angle + side * Math.min(half, 3.13), free.radius));
      semsig.svg(arcs, "path", {
        d: `M${fromX},${fromY}A${free.radius},${free.radius} 0 ${half > 1.57 ? 1 : 0} 1 ${toX},${toY}`,
        stroke: classSign?.colour ?? "#808080", "stroke-width": size, class: "extent"});
    }
    if (isFar(index)) {
      const [textX, textY] = at(angle, free.radius + size + 6);
      const [x, y] = [textX + 6 * Math.sin(angle), textY + 2];
      if (labels.every(([u, v]) => Math.abs(u - x) > 18 || Math.abs(v - y) > 7)) {
        labels.push([x, y]);
        semsig.svg(object, "text", {x, y, "font-size": 6, class: "scale"},
          semsig.lengthText(metres));
      }
    }
    // Smaller outside the sectors, so that they hide less.
    const own = look.metres && verdict === "outside" ? 0.65 * size : size;
    const sign = semsig.svg(object, "g", {transform: `translate(${x},${y}) scale(${own})`});
    if (verdicts[verdict]) semsig.drawFrame(sign, verdicts[verdict]);
    if (classSign) semsig.drawSign(sign, classSign, types[index]);
    else semsig.svg(sign, "circle", {r: 1, class: "north"});
  });
  semsig.text(figure, "figcaption", look.metres ? `${label}, to ${look.reach} m` : label);
  return figure;
};
// The wheel of a first signature next to the wheel of one of `others`, which is chosen by buttons.
// Each has a label, a signature and optionally a line of text and a function that goes to it.
semsig.scenes = (first, others, signs, kind) => {
  const box = L.DomUtil.create("div", "semsig-scenes");
  const wheels = L.DomUtil.create("div", "semsig-wheels", box);
  const words = semsig.comparisons[kind];
  const key = L.DomUtil.create("p", "semsig-key", box);
  const status = L.DomUtil.create("p", "semsig-lit-object", box);
  const lone = kind === "query" ? ["false", "missed"] : ["missed", "false"];
  const hint = "Point at an object to see it on the map.";
  let scenes = [];
  let comparison = [];
  let onLight = () => {};
  const light = (side, index) => {
    const entry = comparison[side]?.[index];
    const pair = index < 0 ? [] : [[side, index], [1 - side, entry?.partner ?? -1]];
    scenes.forEach((_, wheel) => {
      wheels.children[wheel].querySelectorAll(".object").forEach((object, at) => {
        const is = pair.some((mate) => mate[0] === wheel && mate[1] === at);
        object.classList.toggle("lit", is);
      });
    });
    const [types, bearings, look] = scenes[side][1];
    const title = index < 0 ? null : (signs.classes?.[types?.[index]] || semsig.anySign).title;
    status.textContent = index < 0 ? hint : [
      title, semsig.entries(null, bearings, look)[index], words?.[entry?.verdict],
    ].filter(Boolean).join(", ");
    onLight(pair);
  };
  const choose = (at) => {
    scenes = [first, ...(others.length ? [others[at]] : [])].map(({label, signature}) =>
      [label, typeof signature === "function" ? signature() : signature])
      .filter(([, [, bearings]]) => bearings?.length);
    comparison = scenes.length === 2 ? semsig.compare(scenes[0][1], scenes[1][1], lone) : [];
    wheels.replaceChildren(...scenes.map(
      ([label, signature], side) => semsig.wheel(label, signature, signs, comparison[side])));
    wheels.querySelectorAll("figure").forEach((figure, side) => {
      const objects = [...figure.querySelectorAll(".object")];
      objects.forEach((object, index) => {
        L.DomEvent.on(object, "mouseenter focus click", () => light(side, index));
        L.DomEvent.on(object, "mouseleave blur", () => light(side, -1));
        L.DomEvent.on(object, "keydown", (event) => {
          const step = {ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1}[event.key];
          if (!step) return;
          L.DomEvent.stop(event);
          const next = (index + step + objects.length) % objects.length;
          object.setAttribute("tabindex", -1);
          objects[next].setAttribute("tabindex", 0);
          objects[next].focus();
        });
      });
    });
    const counts = {};
    for (const [side, objects] of comparison.entries()) {
      for (const {verdict} of objects) {
        if (side && ["matched", "misnamed"].includes(verdict)) continue;
        counts[verdict] = (counts[verdict] || 0) + 1;
      }
    }
    key.replaceChildren(...Object.keys(words || {}).filter((verdict) => counts[verdict]).map(
      (verdict) => {
        const part = L.DomUtil.create("span", "");
        const sign = semsig.svg(part, "svg", {viewBox: "-1.6 -1.6 3.2 3.2", class: verdict});
        semsig.drawFrame(sign, signs.verdicts[verdict]);
        part.append(`${counts[verdict]} ${words[verdict]}`);
        return part;
      }));
    if (scenes.length) status.textContent = hint;
    choices.forEach((button, index) => { button.setAttribute("aria-pressed", index === at); });
    box.semsigChosen?.();
  };
  const list = L.DomUtil.create("ol", "semsig-choices", box);
  const choices = others.map(({label, line, go}, at) => {
    const item = L.DomUtil.create("li", "", list);
    const button = L.DomUtil.create("button", "", item);
    semsig.text(button, "span", label);
    if (line) semsig.text(button, "small", line);
    L.DomEvent.on(button, "click", () => choose(at));
    if (go) {
      const jump = L.DomUtil.create("button", "semsig-go", item);
      jump.textContent = "Go";
      jump.setAttribute("aria-label", `Go to ${label}`);
      L.DomEvent.on(jump, "click", go);
    }
    return button;
  });
  list.hidden = others.length < 2 && !others[0]?.go;
  choose(0);
  // Draws the objects of both signatures on the map, as signs or, without a distance, as rays.
  box.semsigLights = (map) => {
    const group = L.layerGroup();
    let drawn = [];
    const draw = () => {
      group.clearLayers();
      const markersOf = ([, [types, bearings, look = {}]], side) => bearings.map((angle, index) => {
        if (!look.place || !map.semsigArea) return null;
        const distance = look.metres?.[index] ?? null;
        const end = semsig.offset(
          map, look.place, angle + (look.turn ?? 0), distance ?? look.reach);
        const sign = types && (signs.classes?.[types[index]] || semsig.anySign);
        const icon = distance === null || !sign ? null : semsig.svg(
          null, "svg", {viewBox: "-1.3 -1.3 2.6 2.6", class: "semsig-sign"});
        if (icon) semsig.drawSign(icon, sign, types[index]);
        const marker = icon
          ? L.marker(end, {keyboard: false, zIndexOffset: 1000, icon: L.divIcon(
            {className: "semsig-object", iconSize: [22, 22], html: icon})})
          : L.polyline([look.place, end], {color: "#808080", weight: 2, dashArray: "3 5"});
        marker.on("mouseover", () => light(side, index));
        // A mouse highlights by pointing, so its click goes to the map below; a tap highlights.
        marker.on("click", ({originalEvent}) => {
          if (originalEvent?.pointerType === "mouse") {
            map.fire("click", {latlng: map.mouseEventToLatLng(originalEvent), originalEvent});
          } else light(side, index);
        });
        marker.on("mouseout", () => light(side, -1));
        return marker.addTo(group);
      });
      drawn = scenes.map(markersOf);
    };
    onLight = (pair) => drawn.forEach((markers, side) => {
      markers.forEach((marker, index) => {
        const is = pair.some((mate) => mate[0] === side && mate[1] === index);
        marker?.getElement?.()?.classList.toggle("lit", is);
        marker?.setStyle?.({color: is ? semsig.highlight : "#808080", weight: is ? 5 : 2});
      });
    });
    box.semsigChosen = draw;
    draw();
    return group;
  };
  return box;
};
// The place at a distance in metres and a bearing from grid north from another place.
semsig.offset = (map, place, bearing, metres) => {
  const area = map.semsigArea;
  const [x, y] = semsig.xy(area, place);
  const angle = bearing * Math.PI / 180;
  return semsig.latlng(area, x + metres * Math.sin(angle), y + metres * Math.cos(angle));
};
