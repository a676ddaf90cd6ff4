// A photo, its camera, and the marks on it.
semsig.sign = (item) => {
  const drawing = semsig.svg(null, "svg", {
    class: "semsig-sign", viewBox: "-1.3 -1.3 2.6 2.6", "aria-hidden": true});
  semsig.drawSign(drawing, item, item.symbol);
  return drawing;
};
// The class of marks without a name.
semsig.unnamed = {...semsig.anySign, name: "?", symbol: "?", title: "Something unnamed"};
semsig.classNamed = (session, name) =>
  session.city.classes.find((item) => item.name === name) || semsig.unnamed;
// A range as text: it is in metres, or near, middle or far; null if it is unknown.
semsig.metres = (range) => (
  typeof range === "number" ? `${Math.round(range)} m` : range === "middle" ? "midway" : range ?? "");
// The button of a mark, which is moved by dragging (`drag`) or by arrow keys (`nudge`).
semsig.mark = (session, entry, {drag, nudge}) => {
  const {title} = semsig.classNamed(session, entry.class);
  const button = L.DomUtil.create("button", "mark");
  button.type = "button";
  button.append(semsig.sign(semsig.classNamed(session, entry.class)));
  semsig.text(button, "span", semsig.metres(entry.range));
  button.setAttribute("aria-pressed", String(session.mark === entry));
  button.setAttribute("aria-label", [title, semsig.metres(entry.range)].filter(Boolean).join(", "));
  button.addEventListener("pointerdown", (event) => {
    event.stopPropagation();
    event.preventDefault();
    document.activeElement.blur();  // so that keys move the mark
    if (session.mark !== entry) session.show(session.scene, entry);
    let moved = false;
    const start = {...entry};
    const move = (now) => {
      const [right, down] = [now.clientX - event.clientX, now.clientY - event.clientY];
      moved ||= Math.hypot(right, down) > 4;
      if (moved) drag(start, right, down, now);
    };
    const up = () => {
      document.removeEventListener("pointermove", move);
      document.removeEventListener("pointerup", up);
      document.removeEventListener("pointercancel", up);
    };
    document.addEventListener("pointermove", move);
    document.addEventListener("pointerup", up);
    document.addEventListener("pointercancel", up);
  });
  button.addEventListener("click", () => {
    if (session.mark !== entry) session.show(session.scene, entry);
  });
  button.addEventListener("keydown", (event) => {
    const step = {
      ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]}[event.key];
    if (!step) return;
    event.preventDefault();
    session.mark = entry;
    nudge(...step);
  });
  return button;
};
// A range enlarged by a number of steps of 10 %; an unknown range starts from the middle.
semsig.ranged = ({city: {reach}}, range, steps) => {
  const thirds = {near: 1 / 6, far: 5 / 6};
  const metres = typeof range === "number" ? range : reach * (thirds[range] ?? 1 / 2);
  return Math.min(Math.max(metres * 1.1 ** steps, 1), reach);
};
semsig.middleOf = ({box, x, y}) => (box ? [(box[0] + box[2]) / 2, (box[1] + box[3]) / 2] : [x, y]);
semsig.images = new WeakMap();
// The box of the current stage; each change draws a new one.
semsig.edge = () => document.querySelector("#picture .stage").getBoundingClientRect();
semsig.photo = (session, photo) => {
  const stage = L.DomUtil.create("div", "stage");
  const {width, height} = photo;
  stage.style.aspectRatio = `${width} / ${height}`;
  stage.style.setProperty("--wide", width / height);
  if (photo.url) {
    // Reused, so that it does not blink with every change.
    const image = semsig.images.get(photo) || new Image();
    if (!image.src) {
      Object.assign(image, {src: photo.url, alt: `The photo ${photo.name}`, draggable: false});
    }
    semsig.images.set(photo, image);
    stage.append(image);
  } else {
    semsig.text(stage, "p", `A session does not contain its photos: drop ${photo.name} here to see `
      + "it again. Its marks are used without it too.");
  }
  const place = (element, [left, top, right, bottom]) => Object.assign(element.style, {
    left: `${100 * left / width}%`, top: `${100 * top / height}%`,
    width: `${100 * (right - left) / width}%`, height: `${100 * (bottom - top) / height}%`,
  });
  const shift = (entry, from, right) => {
    const clamp = (x) => Math.min(Math.max(x, 0), width);
    if (from.box) {
      const by = Math.min(Math.max(right, -from.box[0]), width - from.box[2]);
      entry.box = [from.box[0] + by, from.box[1], from.box[2] + by, from.box[3]];
    } else entry.x = clamp(from.x + right);
  };
  for (const entry of photo.marks) {
    if (entry.box) {
      const frame = L.DomUtil.create("div", "frame", stage);
      frame.style.borderColor = semsig.classNamed(session, entry.class).colour;
      place(frame, entry.box);
    }
    // Up and down changes the distance: farther objects are higher in a photo.
    let sideways = null;
    const button = semsig.mark(session, entry, {
      drag: (from, right, down) => {
        sideways ??= Math.abs(right) > Math.abs(down);
        if (sideways) shift(entry, from, right * width / semsig.edge().width);
        else entry.range = semsig.ranged(session, from.range, -down / 8);
        session.changed();
      },
      nudge: (right, up) => {
        if (right) shift(entry, {...entry}, right * width / 100);
        else entry.range = semsig.ranged(session, entry.range, up);
        session.changed();
      },
    });
    const [x, y] = semsig.middleOf(entry);
    Object.assign(button.style, {left: `${100 * x / width}%`, top: `${100 * y / height}%`});
    stage.append(button);
  }
  // A click marks a place, a drag a box.
  stage.addEventListener("pointerdown", (event) => {
    if (event.button || !event.isPrimary) return;
    event.preventDefault();
    const edge = semsig.edge();
    const at = (event) => [
      Math.min(Math.max((event.clientX - edge.left) / edge.width, 0), 1) * width,
      Math.min(Math.max((event.clientY - edge.top) / edge.height, 0), 1) * height,
    ];
    const from = at(event);
    const frame = L.DomUtil.create("div", "frame", stage);
    const boxTo = (event) => {
      const to = at(event);
      return [0, 1].map((part) => Math.min(from[part], to[part])).concat(
        [0, 1].map((part) => Math.max(from[part], to[part])));
    };
    const move = (now) => place(frame, boxTo(now));
    const up = (now) => {
      stage.removeEventListener("pointermove", move);
      frame.remove();
      const box = boxTo(now);
      const large = (box[2] - box[0]) / width * edge.width > 8
        && (box[3] - box[1]) / height * edge.height > 8;
      semsig.addMark(session, large ? {box} : {x: from[0], y: from[1]});
    };
    stage.addEventListener("pointermove", move);
    stage.addEventListener("pointerup", up, {once: true});
    stage.setPointerCapture(event.pointerId);
  });
  return stage;
};
semsig.addMark = (session, where) => {
  const entry = {range: null, ...where, class: session.brush};
  session.entries.push(entry);
  document.activeElement.blur();
  session.show(session.scene, entry);
  session.changed();
};
semsig.readPhotos = async (session, files, {on = false} = {}) => {
  let next = on;
  for (const file of files) {
    if (file.size > session.city.max_upload) {
      const most = Math.round(session.city.max_upload / 2 ** 20);
      throw new Error(`${file.name} has ${Math.round(file.size / 2 ** 20)} MB; give a photo of at `
        + `most ${most} MB.`);
    }
    const path = `photo?name=${encodeURIComponent(file.name)}`;
    const info = await (await semsig.api(path, file)).json();
    const url = URL.createObjectURL(file);
    // A photo of an opened session is recognized by its checksum.
    const scene = session.scenes.find((photo) => photo.sha256 === info.sha256);
    if (scene) {
      scene.url = url;
      session.show(scene);
      continue;
    }
    const wide = info.projection !== "pinhole";
    session.add({...info, url, fromFile: {fov: info.fov, heading: info.heading},
      fov: info.fov ?? (wide ? 360 : 65), heading_error: info.heading_error ?? null, marks: []},
    {on: next});
    if (info.place && session.scenes.length === 1) semsig.map.setView(info.place, 17);
    next = false;
  }
};
// The settings of the camera, with values from the photo where it has them.
semsig.camera = (session, photo) => {
  const box = L.DomUtil.create("fieldset", "camera");
  semsig.text(box, "legend", photo.fromFile?.fov ? "Camera, as the photo says" : "Camera");
  const line = (text) => {
    const label = L.DomUtil.create("label", "", box);
    semsig.text(label, "span", text);
    return label;
  };
  const kinds = {pinhole: "photo", equirectangular: "panorama", cylindrical: "cylindrical panorama",
    fisheye: "fisheye"};
  const kind = semsig.select(line("Kind"), kinds, photo.projection, (value) => {
    photo.projection = value;
    photo.fov = {pinhole: 65, fisheye: 180}[value] || 360;
    session.show(photo, session.mark);
    session.changed();
  });
  kind.id = "kind";
  const slider = (label, name, [low, high], unit) => {
    const input = L.DomUtil.create("input", "", label);
    const output = L.DomUtil.create("output", "", label);
    Object.assign(input, {type: "range", min: low, max: high, step: 1, id: name,
      value: photo[name] ?? 0});
    const showValue = () => { output.textContent = `${Math.round(input.value)}${unit}`; };
    input.addEventListener("input", () => {
      photo[name] = Number(input.value);
      showValue();
      session.changed();
    });
    showValue();
    return input;
  };
  slider(line("Field of view"), "fov", photo.projection === "pinhole" ? [20, 140] : [30, 360], "°");
  const hasHeading = photo.heading !== null;
  semsig.select(line("Looks"), {"": "anywhere (heading unknown)", known: "towards about"},
    hasHeading ? "known" : "", (value) => {
      photo.heading = value ? photo.fromFile?.heading ?? 0 : null;
      photo.heading_error = value ? photo.heading_error ?? 10 : null;
      session.show(photo, session.mark);
      session.changed();
    }).id = "heading-known";
  if (hasHeading) {
    slider(line("Heading"), "heading", [0, 359], "°");
    slider(line("Standard deviation"), "heading_error", [1, 90], "°");
  }
  // A known place is that of the first photo.
  if (photo.place && session.viewOf(photo) === session.views[0]) {
    const near = session.isNear(photo);
    const label = L.DomUtil.create("label", "", box);
    const tick = L.DomUtil.create("input", "", label);
    Object.assign(tick, {type: "checkbox", id: "near", checked: near});
    semsig.text(label, "span", "Use the photo's place");
    const use = (metres) => {
      session.near = tick.checked ? [...photo.place, metres] : null;
      session.changed();
    };
    const error = semsig.number(line("standard deviation (metres)"), near ? session.near[2] : 50,
      [1, 10000], use);
    error.id = "near-metres";
    tick.addEventListener("change", () => use(Number(error.value)));
  }
  for (const note of photo.notes || []) semsig.text(box, "p", note);
  return box;
};
semsig.select = (parent, choices, value, call) => {
  const select = L.DomUtil.create("select", "", parent);
  for (const [key, text] of Object.entries(choices)) select.append(new Option(text, key));
  select.value = value;
  select.addEventListener("change", () => call(select.value));
  return select;
};
