// A photo, its camera, and the marks on it.
semsig.sign = (item) => {
  const drawing = semsig.svg(null, "svg", {
    class: "semsig-sign", viewBox: "-1.3 -1.3 2.6 2.6", "aria-hidden": true});
  semsig.drawSign(drawing, item, item.symbol);
  return drawing;
};
// The class of marks without a name.
semsig.unnamed = {...semsig.anySign, name: "?", symbol: "?", title: "Something unnamed"};
semsig.classNamed = ({city}, name) =>
  [...city.classes, ...city.families].find((item) => item.name === name) || semsig.unnamed;
// What a mark is, what is written on it, and how far it is.
semsig.described = (session, {class: name, range, text}) => [
  semsig.classNamed(session, name).title, text && `\u201c${text}\u201d`, semsig.metres(range)]
  .filter(Boolean).join(", ");
// A range as text: it is in metres, or near, middle or far; null if it is unknown.
semsig.metres = (range) => (
  typeof range === "number" ? `${Math.round(range)} m` : range === "middle" ? "midway" : range ?? "");
// The button of a mark, which is moved by dragging (`drag`) or by arrow keys (`nudge`).
semsig.mark = (session, entry, {drag, nudge}) => {
  const button = L.DomUtil.create("button", "mark");
  button.type = "button";
  button.append(semsig.sign(semsig.classNamed(session, entry.class)));
  semsig.text(button, "span", semsig.metres(entry.range));
  button.setAttribute("aria-pressed", String(session.mark === entry));
  button.setAttribute("aria-label", semsig.described(session, entry));
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
    const up = (now) => {
      document.removeEventListener("pointermove", move);
      document.removeEventListener("pointerup", up);
      document.removeEventListener("pointercancel", up);
      if (!moved && now.type === "pointerup") semsig.askClass(session, entry, now);
    };
    document.addEventListener("pointermove", move);
    document.addEventListener("pointerup", up);
    document.addEventListener("pointercancel", up);
  });
  // By keyboard; a pointer is handled above.
  button.addEventListener("click", (event) => {
    if (event.detail) return;
    if (session.mark !== entry) session.show(session.scene, entry);
    semsig.askClass(session, entry);
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
// Images and zooms of photos by their addresses, so that they stay with every change.
semsig.images = new Map();
semsig.zooms = new Map();
// The box of the whole drawing, and not only its part in view; each change draws a new one.
semsig.edge = () => document.querySelector("#picture .sheet").getBoundingClientRect();
semsig.photo = (session, photo) => {
  const stage = L.DomUtil.create("div", "stage");
  stage.tabIndex = 0;
  stage.setAttribute("role", "group");
  stage.setAttribute("aria-label", "Photo; zoom with + and -, move it with the arrow keys");
  const sheet = L.DomUtil.create("div", "sheet", stage);
  const {width, height} = photo;
  stage.style.aspectRatio = `${width} / ${height}`;
  sheet.style.aspectRatio = `${width} / ${height}`;
  if (photo.url) {
    // Reused, so that it does not blink with every change.
    const image = semsig.images.get(photo.url) || new Image();
    if (!image.src) {
      Object.assign(image, {src: photo.url, alt: `The photo ${photo.name}`, draggable: false});
    }
    semsig.images.set(photo.url, image);
    sheet.append(image);
  } else {
    semsig.text(sheet, "p", `A session does not contain its photos: drop ${photo.name} here to see `
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
      const frame = L.DomUtil.create("div", "frame", sheet);
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
        session.changed(from);
      },
      nudge: (right, up) => {
        if (right) shift(entry, {...entry}, right * width / 100);
        else entry.range = semsig.ranged(session, entry.range, up);
        session.changed(`nudge ${session.entries.indexOf(entry)}`);
      },
    });
    const [x, y] = semsig.middleOf(entry);
    Object.assign(button.style, {left: `${100 * x / width}%`, top: `${100 * y / height}%`});
    sheet.append(button);
  }
  semsig.zoomable(session, photo, stage, sheet);
  const at = (event) => {
    const edge = semsig.edge();
    return [
      Math.min(Math.max((event.clientX - edge.left) / edge.width, 0), 1) * width,
      Math.min(Math.max((event.clientY - edge.top) / edge.height, 0), 1) * height,
    ];
  };
  // A click marks a place, a drag a box.
  stage.addEventListener("pointerdown", (event) => {
    if (event.button || !event.isPrimary || stage.classList.contains("moving")) return;
    event.preventDefault();
    const edge = semsig.edge();
    const from = at(event);
    const frame = L.DomUtil.create("div", "frame", sheet);
    const boxTo = (event) => {
      const to = at(event);
      return [0, 1].map((part) => Math.min(from[part], to[part])).concat(
        [0, 1].map((part) => Math.max(from[part], to[part])));
    };
    const move = (now) => place(frame, boxTo(now));
    const up = (now) => {
      stage.removeEventListener("pointermove", move);
      frame.remove();
      if (stage.classList.contains("pinched")) return;
      const box = boxTo(now);
      const large = (box[2] - box[0]) / width * edge.width > 8
        && (box[3] - box[1]) / height * edge.height > 8;
      semsig.addMark(session, large ? {box} : {x: from[0], y: from[1]}, now);
    };
    stage.addEventListener("pointermove", move);
    stage.addEventListener("pointerup", up, {once: true});
    stage.setPointerCapture(event.pointerId);
  });
  return stage;
};
// Zooms a photo by wheel, keys, buttons and two fingers. It moves with the middle button or, while
// the button for moving is pressed, with any pointer; then a tap marks a place.
semsig.moving = matchMedia("(pointer: coarse)").matches;
semsig.zoomable = (session, photo, stage, sheet) => {
  const key = photo.url || photo.name;
  const zoom = semsig.zooms.get(key) || {scale: 1, x: 0, y: 0};
  semsig.zooms.set(key, zoom);
  // x and y are the shares of the drawing that are left of and above the stage.
  const apply = () => {
    const [wide, high] = [stage.clientWidth, stage.clientHeight];
    if (!wide) return;  // not on the page
    const size = [zoom.scale * wide, zoom.scale * wide * photo.height / photo.width];
    zoom.x = Math.min(Math.max(zoom.x, 0), 1 - wide / size[0]);
    zoom.y = Math.min(Math.max(zoom.y, 0), Math.max(1 - high / size[1], 0));
    Object.assign(sheet.style, {
      width: `${100 * zoom.scale}%`, left: `${-zoom.x * size[0]}px`, top: `${-zoom.y * size[1]}px`});
    stage.classList.toggle("zoomed", zoom.scale > 1 || size[1] > high + 1);
  };
  const zoomBy = (factor, clientX, clientY) => {
    const edge = sheet.getBoundingClientRect();
    const [x, y] = [(clientX - edge.left) / edge.width, (clientY - edge.top) / edge.height];
    const scale = Math.min(Math.max(zoom.scale * factor, 1), 12);
    const grown = scale / zoom.scale;
    zoom.x = x - (x - zoom.x) / grown;
    zoom.y = y - (y - zoom.y) / grown;
    zoom.scale = scale;
    apply();
  };
  const moveBy = (right, down) => {
    const edge = sheet.getBoundingClientRect();
    zoom.x -= right / edge.width;
    zoom.y -= down / edge.height;
    apply();
  };
  const zoomMiddle = (factor) => {
    const {left, top, width, height} = stage.getBoundingClientRect();
    zoomBy(factor, left + width / 2, top + height / 2);
  };
  stage.addEventListener("wheel", (event) => {
    if (zoom.scale === 1 && event.deltaY > 0) return;  // the column scrolls
    event.preventDefault();
    zoomBy(Math.exp(-event.deltaY / (event.ctrlKey ? 100 : 400)), event.clientX, event.clientY);
  }, {passive: false});
  const fingers = new Map();
  stage.addEventListener("pointerdown", (event) => {
    if (event.target.closest(".mark, .tools")) return;
    const mouse = event.pointerType === "mouse";
    if (mouse && event.button !== 1 && !(semsig.moving && !event.button)) return;
    if (!mouse || event.button === 1) event.preventDefault();
    fingers.set(event.pointerId, event);
    let far = false;
    const move = (now) => {
      const before = fingers.get(now.pointerId);
      if (!before) return;
      far ||= Math.hypot(now.clientX - event.clientX, now.clientY - event.clientY) > 6;
      const other = [...fingers.values()].find(({pointerId}) => pointerId !== now.pointerId);
      if (other) {
        stage.classList.add("pinched");
        const apart = ({clientX, clientY}) => Math.hypot(
          clientX - other.clientX, clientY - other.clientY);
        const [x, y] = [(now.clientX + other.clientX) / 2, (now.clientY + other.clientY) / 2];
        zoomBy(apart(now) / Math.max(apart(before), 1), x, y);
        moveBy((now.clientX - before.clientX) / 2, (now.clientY - before.clientY) / 2);
      } else if (far && (semsig.moving || event.button === 1)) {
        moveBy(now.clientX - before.clientX, now.clientY - before.clientY);
      }
      fingers.set(now.pointerId, now);
    };
    const up = (now) => {
      document.removeEventListener("pointermove", move);
      document.removeEventListener("pointerup", up);
      document.removeEventListener("pointercancel", up);
      const single = fingers.size === 1;
      fingers.delete(now.pointerId);
      if (!fingers.size) stage.classList.remove("pinched");
      if (!single || far || !semsig.moving || event.button || now.type !== "pointerup") return;
      const edge = semsig.edge();
      semsig.addMark(session, {
        x: (now.clientX - edge.left) / edge.width * photo.width,
        y: (now.clientY - edge.top) / edge.height * photo.height}, now);
    };
    document.addEventListener("pointermove", move);
    document.addEventListener("pointerup", up);
    document.addEventListener("pointercancel", up);
  });
  const tools = L.DomUtil.create("div", "tools", stage);
  tools.addEventListener("pointerdown", (event) => event.stopPropagation());
  semsig.button(tools, "+", () => zoomMiddle(1.5), "Zoom in").className = "zoom-in";
  semsig.button(tools, "\u2212", () => zoomMiddle(1 / 1.5), "Zoom out").className = "zoom-out";
  const hand = semsig.button(tools, "Move", () => {
    semsig.moving = !semsig.moving;
    showMoving();
  });
  hand.className = "move";
  hand.title = "Drag to move the photo instead of drawing a box";
  const showMoving = () => {
    hand.setAttribute("aria-pressed", String(semsig.moving));
    stage.classList.toggle("moving", semsig.moving);
  };
  showMoving();
  semsig.zoomPhoto = {zoomMiddle, moveBy};
  queueMicrotask(apply);  // as soon as it is on the page
  new ResizeObserver(apply).observe(stage);
};
// Adds a mark of the chosen class; without one, a menu asks for it where it was clicked.
semsig.addMark = (session, where, event) => {
  const known = session.next ?? session.brush;  // the answer to a question comes first
  session.next = null;
  const entry = {range: null, ...where, class: known ?? "?"};
  session.entries.push(entry);
  document.activeElement.blur();
  session.show(session.scene, entry);
  session.changed(entry);
  if (!known) semsig.askClass(session, entry, event, true);
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
      fov: info.fov ?? (wide ? 360 : null), heading_error: info.heading_error ?? null, marks: []},
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
    photo.fov = value === "pinhole" ? null : value === "fisheye" ? 180 : 360;
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
      session.changed(`slide ${name}`);
    });
    showValue();
    return input;
  };
  const [low, high] = session.city.fovs;
  if (photo.projection === "pinhole") {
    semsig.select(line("Field of view"), {"": `unknown (${low}° to ${high}°)`, known: "about"},
      photo.fov === null ? "" : "known", (value) => {
        photo.fov = value ? photo.fromFile?.fov ?? session.answer?.fov ?? 65 : null;
        session.show(photo, session.mark);
        session.changed();
      }).id = "fov-known";
  }
  if (photo.fov !== null) {
    slider(line(photo.projection === "pinhole" ? "Degrees" : "Field of view"), "fov",
      photo.projection === "pinhole" ? [20, 140] : [30, 360], "°");
  } else semsig.text(box, "p", "").id = "likeliest-fov";
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
