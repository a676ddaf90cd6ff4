semsig.svg = (parent, name, values, text) => {
  const part = L.SVG.create(name);
  for (const [key, value] of Object.entries(values)) part.setAttribute(key, value);
  if (text !== undefined) part.textContent = text;
  parent?.append(part);
  return part;
};
// The sign of a class, and the frame of what became of an object, around (0, 0).
semsig.drawSign = (parent, {outline, colour, ink, drop}, symbol) => {
  semsig.svg(parent, "path", {d: outline, fill: colour, class: "sign"});
  semsig.svg(parent, "text", {y: drop + 0.42, "font-size": 1.2, fill: ink}, symbol);
};
semsig.drawFrame = (parent, {outline, colour}) => {
  semsig.svg(parent, "path", {d: outline, stroke: colour, class: "frame", transform: "scale(1.45)"});
};
// Of a class that no sign is known of.
semsig.anySign = {outline: "M-1,0A1,1 0 1 1 1,0A1,1 0 1 1 -1,0Z", colour: "#808080",
  ink: "#ffffff", drop: 0, title: "any class"};
// What is told of each object of a signature.
semsig.entries = (types, bearings, look = {}) => bearings.map((degrees, one) => {
  const metres = look.metres?.[one] ?? null;
  const far = metres === null ? "" : `\u00a0${metres}\u00a0m`;
  const outside = look.outside?.includes(one) ? "\u00a0(outside)" : "";
  return `${types ? `${types[one]}\u00a0` : ""}${degrees}\u00b0${far}${outside}`;
});
// What became of the objects of two signatures: by kind of what is compared, in words.
semsig.comparisons = {
  query: {matched: "matched", misnamed: "misnamed", missed: "missed", false: "extra"},
  cells: {matched: "in both", misnamed: "of another class", missed: "only here",
    false: "only there"},
  dates: {matched: "still there", misnamed: "of another class", missed: "gone", false: "new"},
};
// Which objects of two signatures are the same, and which have no partner: for each object of
// both, `partner` (or -1) and `verdict`; `lone` has the verdicts of those without, by side.
semsig.compare = ([types, bearings, look = {}], [others, degrees, otherLook = {}], lone) => {
  const sides = [[types, bearings, look], [others, degrees, otherLook]];
  const partner = sides.map(([, angles]) => angles.map(() => -1));
  const turn = (otherLook.turn ?? 0) - (look.turn ?? 0);
  const pairs = [];
  const same = (one, other) => !types || !others || types[one] === others[other];
  bearings.forEach((angle, one) => {
    if (look.outside?.includes(one)) return;
    degrees.forEach((otherAngle, other) => {
      if (otherLook.outside?.includes(other)) return;
      const off = Math.abs(((otherAngle + turn - angle) % 360 + 540) % 360 - 180);
      const [near, far] = [look.metres?.[one] ?? null, otherLook.metres?.[other] ?? null];
      const apart = near === null || far === null ? 0 : Math.abs(near - far);
      const alike = same(one, other);
      if (off <= (alike ? 25 : 12)) pairs.push([off + apart + (alike ? 0 : 20), one, other]);
    });
  });
  for (const [, one, other] of pairs.sort((a, b) => a[0] - b[0])) {
    if (partner[0][one] >= 0 || partner[1][other] >= 0) continue;
    [partner[0][one], partner[1][other]] = [other, one];
  }
  return sides.map(([, angles, {outside}], side) => angles.map((_, one) => {
    const mate = partner[side][one];
    const [first, second] = side ? [mate, one] : [one, mate];
    const verdict = outside?.includes(one) ? "outside" : mate < 0 ? lone[side]
      : same(first, second) ? "matched" : "misnamed";
    return {partner: mate, verdict};
  }));
};
// A signature as it is seen from above: north up, every object at its bearing. A view has a look:
// metres to each object, null where unknown, the reach of the ring in metres, the sectors that were
// looked at, and the objects outside them. `signs` are those of the classes by symbol.
semsig.wheel = (label, [types, bearings, look = {}], {classes = {}, verdicts = {}}, told = []) => {
  const figure = L.DomUtil.create("figure", "");
  const drawing = semsig.svg(figure, "svg", {viewBox: "-58 -68 116 126", role: "group"});
  const places = bearings.map((degrees) => degrees * Math.PI / 180);
  const at = (angle, radius) => [radius * Math.sin(angle), -radius * Math.cos(angle)];
  const entries = semsig.entries(types, bearings, look).map(
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
  // Signs that would lie on one another go nearer to the middle.
  const size = !types ? 3 : bearings.length <= 16 ? 6 : 5.2;
  const circles = [];
  for (let radius = 52 - size; radius > size; radius -= 2.2 * size) {
    circles.push({radius, taken: []});
  }
  places.forEach((angle, one) => {
    const room = ({radius, taken}) => Math.min(7, ...taken.map((other) => {
      const turn = Math.abs(angle - other) % (2 * Math.PI);
      return Math.min(turn, 2 * Math.PI - turn);
    })) * radius;
    // Where it is known how far away they are, they stand about as far out.
    const metres = look.metres?.[one] ?? null;
    const out = metres === null ? 54 : Math.min(1, metres / look.reach) * circles[0].radius;
    const nearest = [...circles].sort(
      (a, b) => Math.abs(a.radius - out) - Math.abs(b.radius - out));
    const free = nearest.find((circle) => room(circle) >= 2.2 * size)
      || circles.reduce((best, circle) => (room(circle) > room(best) ? circle : best));
    free.taken.push(angle);
    const verdict = told[one]?.verdict ?? (look.outside?.includes(one) ? "outside" : "");
    const object = semsig.svg(drawing, "g", {
      class: `object ${verdict}`, role: "img", tabindex: one ? -1 : 0,
      "aria-label": [entries[one], classes[types?.[one]]?.title].filter(Boolean).join(", "),
    });
    if (metres === null) {
      const [[x, y], [outX, outY]] = [at(angle, free.radius + size), at(angle, 54)];
      semsig.svg(object, "line", {x1: x, y1: y, x2: outX, y2: outY, class: "ray"});
    }
    const [x, y] = at(angle, free.radius);
    const sign = semsig.svg(object, "g", {transform: `translate(${x},${y}) scale(${size})`});
    const known = types && (classes[types[one]] || semsig.anySign);
    if (verdicts[verdict]) semsig.drawFrame(sign, verdicts[verdict]);
    if (known) semsig.drawSign(sign, known, types[one]);
    else semsig.svg(sign, "circle", {r: 1, class: "north"});
  });
  semsig.text(figure, "figcaption", look.metres ? `${label}, to ${look.reach} m` : label);
  return figure;
};
// A scene, and beside it one of others to choose from, each with a label, a signature and what
// else there is: a line more, and where to go to.
semsig.scenes = (first, others, signs, kind) => {
  const box = L.DomUtil.create("div", "semsig-scenes");
  const wheels = L.DomUtil.create("div", "semsig-wheels", box);
  const words = semsig.comparisons[kind];
  const key = L.DomUtil.create("p", "semsig-key", box);
  const said = L.DomUtil.create("p", "semsig-lit-object", box);
  const lone = kind === "query" ? ["false", "missed"] : ["missed", "false"];
  const hint = "Point at an object to see it on the map.";
  let shown = [];
  let told = [];
  let onLight = () => {};
  const light = (side, one) => {
    const lit = one < 0 ? [] : [[side, one], [1 - side, told[side]?.[one]?.partner ?? -1]];
    shown.forEach((_, wheel) => {
      wheels.children[wheel].querySelectorAll(".object").forEach((object, at) => {
        object.classList.toggle("lit", lit.some((mate) => mate[0] === wheel && mate[1] === at));
      });
    });
    const [types, bearings, look] = shown[side][1];
    const title = one < 0 ? null : (signs.classes?.[types?.[one]] || semsig.anySign).title;
    said.textContent = one < 0 ? hint : [
      title, semsig.entries(null, bearings, look)[one], words?.[told[side]?.[one]?.verdict],
    ].filter(Boolean).join(", ");
    onLight(lit);
  };
  const choose = (at) => {
    shown = [first, ...(others.length ? [others[at]] : [])].map(({label, signature}) =>
      [label, typeof signature === "function" ? signature() : signature])
      .filter(([, [, bearings]]) => bearings?.length);
    told = shown.length === 2 ? semsig.compare(shown[0][1], shown[1][1], lone) : [];
    wheels.replaceChildren(...shown.map(
      ([label, signature], side) => semsig.wheel(label, signature, signs, told[side])));
    wheels.querySelectorAll("figure").forEach((figure, side) => {
      const objects = [...figure.querySelectorAll(".object")];
      objects.forEach((object, one) => {
        L.DomEvent.on(object, "mouseenter focus click", () => light(side, one));
        L.DomEvent.on(object, "mouseleave blur", () => light(side, -1));
        L.DomEvent.on(object, "keydown", (event) => {
          const step = {ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1}[event.key];
          if (!step) return;
          L.DomEvent.stop(event);
          const next = (one + step + objects.length) % objects.length;
          object.setAttribute("tabindex", -1);
          objects[next].setAttribute("tabindex", 0);
          objects[next].focus();
        });
      });
    });
    const counts = {};
    for (const [side, objects] of told.entries()) {
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
    if (shown.length) said.textContent = hint;
    choices.forEach((button, one) => { button.setAttribute("aria-pressed", one === at); });
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
  // The objects on the map, where it is known or can be drawn where they are.
  box.semsigLights = (map) => {
    const group = L.layerGroup();
    let drawn = [];
    const draw = () => {
      group.clearLayers();
      drawn = shown.map(([, [types, bearings, look = {}]], side) => bearings.map((angle, one) => {
        if (!look.place || !map.semsigArea) return null;
        const known = look.metres?.[one] ?? null;
        const end = semsig.offset(
          map, look.place, angle + (look.turn ?? 0), known ?? look.reach);
        const sign = types && (signs.classes?.[types[one]] || semsig.anySign);
        const icon = known === null || !sign ? null : semsig.svg(
          null, "svg", {viewBox: "-1.3 -1.3 2.6 2.6", class: "semsig-sign"});
        if (icon) semsig.drawSign(icon, sign, types[one]);
        const marker = icon
          ? L.marker(end, {keyboard: false, zIndexOffset: 1000, icon: L.divIcon(
            {className: "semsig-object", iconSize: [22, 22], html: icon})})
          : L.polyline([look.place, end], {color: "#808080", weight: 2, dashArray: "3 5"});
        marker.on("mouseover", () => light(side, one));
        // A finger cannot point; a mouse does, and its click asks for what is below.
        marker.on("click", ({originalEvent}) => {
          if (originalEvent?.pointerType === "mouse") {
            map.fire("click", {latlng: map.mouseEventToLatLng(originalEvent), originalEvent});
          } else light(side, one);
        });
        marker.on("mouseout", () => light(side, -1));
        return marker.addTo(group);
      }));
    };
    onLight = (lit) => drawn.forEach((markers, side) => {
      markers.forEach((marker, one) => {
        const is = lit.some((mate) => mate[0] === side && mate[1] === one);
        marker?.getElement?.()?.classList.toggle("lit", is);
        marker?.setStyle?.({color: is ? semsig.pointed : "#808080", weight: is ? 5 : 2});
      });
    });
    box.semsigChosen = draw;
    draw();
    return group;
  };
  return box;
};
// A place so many metres from another, by a bearing from grid north.
semsig.offset = (map, place, bearing, metres) => {
  const area = map.semsigArea;
  const [x, y] = semsig.xy(area, place);
  const angle = bearing * Math.PI / 180;
  return semsig.latlng(area, x + metres * Math.sin(angle), y + metres * Math.cos(angle));
};
