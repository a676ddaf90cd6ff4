// A view composed by hand: objects with their direction and rough distance.
semsig.compass = (session, view) => {
  const {reach} = session.city;
  const stage = L.DomUtil.create("div", "stage sheet compass");
  const drawing = L.SVG.create("svg");
  drawing.setAttribute("viewBox", "-120 -120 240 240");
  drawing.setAttribute("aria-hidden", "true");
  stage.append(drawing);
  const rim = 90;  // objects at the rim and outside have an unknown distance
  const draw = (name, values, text) => semsig.svg(drawing, name, values, text);
  const turned = (bearing, out) => {
    const angle = bearing * Math.PI / 180;
    return [out * Math.sin(angle), -out * Math.cos(angle)];
  };
  // Marks of unknown distance stand outside the rim, on three rings if they are many.
  const rings = [rim + 8, rim + 21, rim + 34].map((out) => ({out, bearings: []}));
  const ringOf = new Map();
  for (const entry of view.compass.filter(({range}) => range === null)) {
    const space = ({out, bearings}) => Math.min(999, ...bearings.map(
      (other) => Math.abs((other - entry.bearing + 540) % 360 - 180) * out));
    const free = rings.find((ring) => space(ring) > 900)
      || rings.reduce((best, ring) => (space(ring) > space(best) ? ring : best));
    free.bearings.push(entry.bearing);
    ringOf.set(entry, free.out);
  }
  const outOf = (entry) => ringOf.get(entry)
    ?? (rim - 8) * semsig.share(semsig.ranged(session, entry.range, 0), reach);
  for (const [from, to] of view.sectors || []) {
    const [[x, y], [endX, endY]] = [turned(from, rim), turned(to, rim)];
    const large = (to - from + 360) % 360 > 180 ? 1 : 0;
    draw("path", {d: `M0,0L${x},${y}A${rim},${rim} 0 ${large} 1 ${endX},${endY}Z`, class: "looked"});
  }
  for (const share of [1 / 3, 2 / 3, 1]) {
    draw("circle", {r: (rim - 8) * semsig.share(reach * share, reach), class: "third"});
  }
  draw("circle", {r: rim, class: "ring"});
  draw("circle", {r: 2, class: "north"});
  const unknown = view.heading_error !== null;
  for (const [at, letter] of [..."NESW"].entries()) {
    const [x, y] = turned(90 * at, 113);
    draw("text", {x, y: y + 4, class: unknown ? "letter pale" : "letter"}, letter);
  }
  semsig.text(stage, "p", `out to ${reach} m`);
  for (const entry of view.compass) {
    const [x, y] = turned(entry.bearing, outOf(entry));
    draw("line", {x1: 0, y1: 0, x2: x, y2: y, class: "ray"});
  }
  // The bearing and, inside the rim, the distance of a place on the compass.
  const read = (event) => {
    const edge = semsig.edge();
    const x = (event.clientX - edge.left) / edge.width * 240 - 120;
    const y = (event.clientY - edge.top) / edge.height * 240 - 120;
    const out = Math.hypot(x, y);
    const range = Math.max(semsig.metresAt(Math.min(out / (rim - 8), 1), reach), 1);
    return {
      bearing: Math.round((Math.atan2(x, -y) * 180 / Math.PI + 360) % 360) % 360,
      range: out > rim ? null : Math.round(range),
    };
  };
  for (const entry of view.compass) {
    const button = semsig.mark(session, entry, {
      drag: (from, _right, _down, event) => {
        Object.assign(entry, read(event));
        session.changed(from);
      },
      nudge: (right, up) => {
        if (right) entry.bearing = (entry.bearing + 5 * right + 360) % 360;
        else entry.range = semsig.ranged(session, entry.range, up);
        session.changed(`nudge ${view.compass.indexOf(entry)}`);
      },
    });
    const [x, y] = turned(entry.bearing, outOf(entry));
    Object.assign(button.style, {left: `${(x + 120) / 2.4}%`, top: `${(y + 120) / 2.4}%`});
    button.setAttribute(
      "aria-label", `${button.getAttribute("aria-label")}, at ${Math.round(entry.bearing)}°`);
    stage.append(button);
  }
  stage.addEventListener("pointerdown", (event) => {
    if (event.button || !event.isPrimary) return;
    event.preventDefault();
    semsig.addMark(session, read(event), event);
  });
  return stage;
};
// The visible sector, and whether north is known.
semsig.compassTurn = (session, view) => {
  const box = L.DomUtil.create("fieldset", "camera");
  semsig.text(box, "legend", "Looked at");
  const again = () => {
    session.show(view, session.mark);
    session.changed();
  };
  const label = (text) => {
    const line = L.DomUtil.create("label", "", box);
    semsig.text(line, "span", text);
    return line;
  };
  semsig.select(label("Seen"), {"": "all round", part: "between two bearings"},
    view.sectors ? "part" : "", (value) => {
      view.sectors = value ? [[315, 45]] : null;
      again();
    }).id = "turn-seen";
  for (const [at, text] of view.sectors ? ["From", "Clockwise to"].entries() : []) {
    semsig.number(label(text), view.sectors[0][at], [0, 359], (value) => {
      const sector = [...view.sectors[0]];
      sector[at] = value;
      view.sectors = [sector, ...view.sectors.slice(1)];
      again();
    }).id = `sector-${at}`;
  }
  semsig.select(label("North"), {"": "known", unknown: "unknown"},
    view.heading_error ?? "", (value) => {
      view.heading_error = value || null;
      again();
    }).id = "north";
  return box;
};
semsig.number = (parent, value, [low, high], call) => {
  const input = L.DomUtil.create("input", "", parent);
  Object.assign(input, {type: "number", min: low, max: high, step: "any", value});
  input.addEventListener("change", () => {
    if (input.value !== "" && input.checkValidity()) call(Number(input.value));
    else input.reportValidity();
  });
  return input;
};
