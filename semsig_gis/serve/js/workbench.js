// The page: palette, scenes, editor, and the actions of the buttons.
semsig.element = (id) => document.getElementById(id);
semsig.notice = (text) => {
  const box = semsig.element("notice");
  box.replaceChildren();
  box.hidden = !text;
  if (!text) return;
  semsig.text(box, "span", text);
  const close = L.DomUtil.create("button", "", box);
  Object.assign(close, {type: "button", textContent: "Close"});
  close.addEventListener("click", () => semsig.notice(""));
};
// Wraps an action: its errors are shown on the page.
semsig.trying = (call) => async (...values) => {
  semsig.notice("");
  document.body.setAttribute("aria-busy", "true");
  try {
    await call(...values);
  } catch (error) {
    semsig.notice(error.message);
  }
  document.body.removeAttribute("aria-busy");
};
semsig.button = (parent, text, call, label) => {
  const button = L.DomUtil.create("button", "", parent);
  Object.assign(button, {type: "button", textContent: text});
  if (label) button.setAttribute("aria-label", label);
  button.addEventListener("click", call);
  return button;
};
// A class for the next marks, instead of a menu at each; of many classes, by family and by search.
semsig.palette = (session) => {
  const [box, search] = ["palette", "palette-search"].map(semsig.element);
  const ask = {name: "", title: "Ask at each mark"};
  const chosen = () => {
    for (const button of box.querySelectorAll("button")) {
      button.setAttribute("aria-pressed", String(button.dataset.name === (session.brush ?? "")));
    }
  };
  const add = (parent, items) => items.forEach((item) => {
    const button = L.DomUtil.create("button", "class", parent);
    button.type = "button";
    if (item.name) button.append(semsig.sign(item));
    semsig.text(button, "span", item.title);
    button.dataset.name = item.name;
    button.addEventListener("click", () => {
      session.brush = item.name || null;
      session.notify("change");
    });
  });
  const show = () => {
    box.replaceChildren();
    add(box, [ask]);
    if (search.value) add(box, semsig.kindsLike(session, search.value));
    else {
      semsig.kindGroups(session).forEach(({title, items}, at) => {
        if (!title) {
          add(box, items);
          return;
        }
        const part = L.DomUtil.create("details", "", box);
        part.open = at === 0;
        semsig.text(part, "summary", title);
        add(part, items);
      });
    }
    chosen();
  };
  search.hidden = !session.city.families.length;
  search.addEventListener("input", show);
  session.addEventListener("change", chosen);
  show();
};
semsig.showScenes = (session) => {
  const box = semsig.element("scenes");
  box.replaceChildren();
  session.views.forEach((view, place) => {
    const group = L.DomUtil.create("span", "view", box);
    if (session.views.length > 1) semsig.text(group, "small", `Place ${place + 1}`);
    for (const scene of view.photos || [view]) {
      const name = scene.marks ? scene.name : session.truth ? "Simulated view" : "Compass";
      const tab = semsig.button(group, name, () => session.show(scene));
      tab.className = "tab";
      tab.setAttribute("aria-pressed", String(scene === session.scene));
      semsig.button(group, "\u00d7", () => {
        const count = (scene.marks || scene.compass).length;
        if (!count || session.truth || window.confirm(
          `Remove ${name} with its ${count} mark${count === 1 ? "" : "s"}?`)) session.remove(scene);
      }, `Remove ${name}`);
    }
  });
  const chooser = (id, text, call) => {
    const label = L.DomUtil.create("label", "button", box);
    label.htmlFor = id;
    label.textContent = text;
    const input = L.DomUtil.create("input", "", label);
    Object.assign(input, {type: "file", id, multiple: true});
    input.addEventListener("change", semsig.trying(() => {
      const files = [...input.files];
      input.value = "";  // so that the same file can be chosen again
      return call(files);
    }));
    return input;
  };
  const photos = {accept: "image/*"};
  const joins = session.views.at(-1)?.photos;
  Object.assign(chooser("photo", joins ? "+ Photo of this place" : "+ Photo",
    (files) => semsig.readPhotos(session, files)), photos);
  if (joins) {
    Object.assign(chooser("photo-on", "+ Photo some steps on",
      (files) => semsig.readPhotos(session, files, {on: true})), photos);
    chooser("boxes", "+ Boxes of a detector", (files) => semsig.readBoxes(session, files));
  }
  semsig.button(box, "+ Compass", () => session.add(
    {compass: [], sectors: null, heading_error: null})).id = "add-compass";
};
semsig.readBoxes = async (session, files) => {
  const photos = session.scenes.filter((scene) => scene.marks);
  const cameraOf = ({name, width, height, fov, heading, projection, horizon}) => (
    {name, width, height, fov, heading, projection, horizon});
  const labels = files.find(({name}) => name === "classes.txt");  // labels of YOLO boxes
  const classes = await labels?.text();
  for (const file of files.filter((other) => other !== labels)) {
    const body = {text: await file.text(), name: file.name, photos: photos.map(cameraOf), classes};
    const read = await (await semsig.api("boxes", body)).json();
    for (const photo of photos) {
      for (const {box, class: name} of read.photos[photo.name] || []) {
        photo.marks.push({box, class: name, range: null});
      }
    }
    semsig.notice(read.notes.join(" "));
  }
  const noise = semsig.element("noise");
  if (noise.value === "by-hand") session.noise = noise.value = "photo";
  session.show(session.scene);
  session.changed();
};
semsig.showScene = (session) => {
  const {scene} = session;
  semsig.element("welcome").hidden = Boolean(scene);
  semsig.element("scene").hidden = semsig.element("marking").hidden = !scene;
  if (!scene) return;
  const focused = document.activeElement;
  const again = focused === document.body || focused.matches("#picture .mark");
  const own = focused.matches("#picture .stage") ? ".stage" : focused.closest("#picture .tools")
    ? `.${focused.className}` : null;
  semsig.element("picture").replaceChildren(
    (scene.marks ? semsig.photo : semsig.compass)(session, scene));
  const mark = document.querySelector("#picture .mark[aria-pressed=true]");
  if (own) document.querySelector(`#picture ${own}`)?.focus({preventScroll: true});
  else if (again && mark) mark.focus({preventScroll: true});
  semsig.showMarks(session);
  semsig.showEditor(session);
};
semsig.showMarks = (session) => {
  const line = semsig.element("marks");
  line.replaceChildren(...session.entries.map((entry) => {
    const button = L.DomUtil.create("button", "");
    button.type = "button";
    button.append(semsig.sign(semsig.classNamed(session, entry.class)));
    semsig.text(button, "span", semsig.described(session, entry));
    button.setAttribute("aria-pressed", String(entry === session.mark));
    button.addEventListener("click", () => session.show(
      session.scene, entry === session.mark ? null : entry));
    return button;
  }));
  const {scene} = session;
  semsig.button(line, "+ Mark in the middle", () => semsig.addMark(
    session, scene.marks ? {x: scene.width / 2, y: scene.height / 2} : {bearing: 0})).id = "add-mark";
};
// The selected mark: its class, what is written on it, and its distance.
semsig.showEditor = (session) => {
  const box = semsig.element("editor");
  const {mark, city: {reach}} = session;
  box.replaceChildren();
  if (!mark) return;
  const label = (text) => {
    const line = L.DomUtil.create("label", "", box);
    semsig.text(line, "span", text);
    return line;
  };
  const titles = semsig.kinds(session).map((item) => [item.name, item.title]);
  semsig.select(label("It is"), Object.fromEntries(titles), mark.class, (value) => {
    mark.class = value;
    session.changed();
  }).id = "class";
  const text = L.DomUtil.create("input", "", label("Reads"));
  Object.assign(text, {type: "text", id: "text", value: mark.text ?? "", maxLength: 200,
    placeholder: "name, sign or number", autocomplete: "off", spellcheck: false});
  text.addEventListener("change", () => {
    mark.text = text.value.trim() || null;
    session.changed();
  });
  const choices = {
    "": mark.box ? "from its box" : "unknown", near: `near, up to ${Math.round(reach / 3)} m`,
    middle: "midway", far: `far, up to ${Math.round(reach)} m`};
  if (typeof mark.range === "number") choices[mark.range] = `about ${semsig.metres(mark.range)}`;
  semsig.select(label("Distance"), choices, mark.range ?? "", (value) => {
    mark.range = value in {near: 0, middle: 0, far: 0} ? value : null;
    session.changed();
  }).id = "range";
  semsig.button(box, "Remove", () => semsig.removeMark(session)).id = "remove-mark";
};
semsig.removeMark = (session) => {
  session.entries.splice(session.entries.indexOf(session.mark), 1);
  session.show(session.scene);
  session.changed();
};
semsig.showCamera = (session) => {
  const {scene} = session;
  if (!scene) return;
  const box = semsig.element("camera");
  box.replaceChildren();
  const {step} = session.viewOf(scene);
  if (step) {
    const line = L.DomUtil.create("fieldset", "camera", box);
    semsig.text(line, "legend", "From the place before");
    for (const [name, text, range] of [
      ["metres", "Metres", [0, 10000]], ["bearing", "Towards (degrees from north)", [0, 359]]]) {
      const label = L.DomUtil.create("label", "", line);
      semsig.text(label, "span", text);
      semsig.number(label, step[name], range, (value) => {
        step[name] = value;
        session.changed();
      }).id = `step-${name}`;
    }
  }
  box.append((scene.marks ? semsig.camera : semsig.compassTurn)(session, scene));
};
// Questions about what to look for next, the most informative first.
semsig.suggest = (session) => {
  const line = semsig.element("question");
  let waiting = null;
  session.addEventListener("change", () => clearTimeout(waiting));
  session.addEventListener("answer", () => {
    clearTimeout(waiting);
    const {answer} = session;
    line.replaceChildren();
    // An absent class is about the place of the first view.
    const first = session.scene && session.viewOf(session.scene) === session.views[0];
    const set = (values) => {
      Object.assign(session, values);
      session.changed();
    };
    const listed = L.DomUtil.create("span", "absent", line);
    const list = (key, textOf, meaning) => {
      for (const name of session[key]) {
        const title = semsig.classNamed(session, name).title.toLowerCase();
        semsig.button(listed, `${textOf(title)} \u00d7`,
          () => set({[key]: session[key].filter((other) => other !== name)}), meaning(title));
      }
    };
    list("absent", (title) => `No ${title}`, (title) => `Forget that no ${title} is there`);
    list("unsure", (title) => `Not known: ${title}`, (title) => `Ask about ${title} again`);
    if (!answer?.estimate || answer.quick) return;
    // After a pause, so that the next answer does not have to wait.
    waiting = setTimeout(async () => {
      let offers = [];
      try {
        offers = await (await semsig.api("suggest", session.body())).json();
      } catch {
        return;  // the answer shows the error
      }
      if (session.answer !== answer) return;
      const offer = offers.find(({class: name}) => !session.unsure.includes(name));
      line.replaceChildren(listed);
      if (!offer) return;
      semsig.text(line, "b", offer.question);
      semsig.button(line, "Yes, I mark it", () => {
        session.next = offer.class;
        line.replaceChildren(listed);
        semsig.text(line, "b", `Click the ${offer.title.toLowerCase()}.`);
      });
      if (first) semsig.button(line, "No", () => set({absent: [...session.absent, offer.class]}));
      semsig.button(line, "Don\u2019t know",
        () => set({unsure: [...session.unsure, offer.class]}));
    }, 400);
  });
};
// Whether marks may be lost: asks if some are not saved.
semsig.mayLose = (session, what) => !session.unsaved || window.confirm(
  `${what} removes the current marks, which are not saved. Continue?`);
semsig.history = (session) => {
  const [undo, redo] = ["undo", "redo"].map(semsig.element);
  const show = () => {
    undo.disabled = !session.past.length;
    redo.disabled = !session.future.length;
  };
  undo.addEventListener("click", () => session.undo());
  redo.addEventListener("click", () => session.redo());
  session.addEventListener("change", show);
  show();
  document.addEventListener("keydown", (event) => {
    const {key, target} = event;
    if (!(event.ctrlKey || event.metaKey) || event.altKey) return;
    if (target.closest("input:not([type=range]), textarea, dialog")) return;
    const letter = key.toLowerCase();
    if (letter === "y" || (letter === "z" && event.shiftKey)) session.redo();
    else if (letter === "z") session.undo();
    else return;
    event.preventDefault();
  });
  window.addEventListener("beforeunload", (event) => {
    if (session.unsaved) event.preventDefault();
  });
};
semsig.simulate = (session, map) => {
  const [button, panel] = ["simulate", "spoiling"].map(semsig.element);
  let [seed, place] = [0, null];
  const on = () => button.getAttribute("aria-pressed") === "true";
  button.addEventListener("click", () => {
    button.setAttribute("aria-pressed", String(!on()));
    panel.hidden = !on();
    map.getContainer().classList.toggle("simulating", on());
  });
  const spoil = semsig.element("spoil");
  spoil.append(new Option("no errors", ""),
    ...session.city.noise.map((name) => new Option(`${name} noise`, name)));
  const draw = semsig.trying(async () => {
    if (!place) throw new Error("Click a place on the map first: a view from there is simulated.");
    if (session.views.length && !session.truth
      && !window.confirm("A simulated view replaces the current marks. Continue?")) return;
    const turn = Number(semsig.element("turn").value);
    const fov = turn === 360 ? null : turn;
    const {view, truth} = await (await semsig.api("simulate", {
      place: [place.lat, place.lng], fov, heading: fov && 0, noise: spoil.value || null, seed,
    })).json();
    session.clear();
    session.truth = truth.place;
    session.add({heading_error: null, sectors: null, ...view});
  });
  map.on("click", (event) => {
    if (!on()) return;
    place = event.latlng;
    draw();
  });
  for (const element of ["turn", "spoil"].map(semsig.element)) {
    element.addEventListener("change", () => { if (place) draw(); });
  }
  semsig.element("again").addEventListener("click", () => {
    seed += 1;
    draw();
  });
};
semsig.files = (session) => {
  const {element, trying} = semsig;
  element("new").addEventListener("click", () => {
    if (!semsig.mayLose(session, "A new question")) return;
    session.clear();
    session.show(null);
    session.changed();
  });
  element("save").addEventListener("click", () => {
    session.savedPresent = session.present;
    semsig.download("session.semsig.json",
      new Blob([JSON.stringify(session.saved(), null, 1)], {type: "application/json"}));
  });
  const open = async (file) => {
    let saved = null;
    try {
      saved = JSON.parse(await file.text());
    } catch {
      saved = null;
    }
    session.restore(saved);
  };
  element("open").addEventListener("change", trying(async () => {
    const [file] = element("open").files;
    element("open").value = "";
    if (file && semsig.mayLose(session, "Another session")) await open(file);
  }));
  element("format").addEventListener("change", trying(async () => {
    const format = element("format").value;
    element("format").value = "";
    const response = await semsig.api(`export?format=${format}`, session.body());
    semsig.download(`answer.${format}`, await response.blob());
  }));
  element("command").addEventListener("click", trying(async () => {
    const command = session.answer?.command;
    if (!command) throw new Error("There is no answer yet, so there is no command for it.");
    const dialog = element("line");
    dialog.querySelector("textarea").value = command;
    dialog.showModal();
    dialog.querySelector("textarea").select();
    dialog.querySelector("button").onclick = () => dialog.close();
    await navigator.clipboard?.writeText(command).catch(() => {});
  }));
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", trying(async (event) => {
    event.preventDefault();
    const files = [...event.dataTransfer.files];
    const text = files.filter(({name}) => /\.(json|txt|xml)$/i.test(name));
    await semsig.readPhotos(session, files.filter((file) => !text.includes(file)));
    if (text.length) await semsig.readBoxes(session, text);
  }));
};
semsig.keys = (session) => {
  document.addEventListener("keydown", (event) => {
    const {target, key} = event;
    if (event.ctrlKey || event.metaKey || event.altKey || !session.scene) return;
    if (target.closest("input, select, textarea, dialog, #classes, #map")) return;
    const factor = {"+": 1.5, "=": 1.5, "-": 1 / 1.5}[key];
    const step = {
      ArrowLeft: [60, 0], ArrowRight: [-60, 0], ArrowUp: [0, 60], ArrowDown: [0, -60]}[key];
    if (factor && session.scene.marks) semsig.zoomPhoto.zoomMiddle(factor);
    else if (step && target.matches(".stage.zoomed")) semsig.zoomPhoto.moveBy(...step);
    else if (session.mark && ["Delete", "Backspace"].includes(key)) semsig.removeMark(session);
    else if (session.mark && key === "Escape") session.show(session.scene);
    else if (session.mark && /^\p{L}$/u.test(key)) {
      semsig.askClass(session, session.mark, null, false, key);
    } else return;
    event.preventDefault();
  });
};
semsig.cityMap = (city) => {
  const map = L.map("map", {
    maxZoom: city.max_zoom, zoomSnap: 0.25, zoomControl: false, attributionControl: true});
  L.control.zoom({position: "topleft"}).addTo(map);
  map.fitBounds(city.bounds);
  L.control.scale({imperial: false}).addTo(map);
  L.imageOverlay(city.image.url, city.image.bounds, {
    pane: "tilePane", className: "semsig-flip"}).addTo(map);
  const credit = L.DomUtil.create("bdi", "");
  credit.textContent = `\u00a9 ${city.credit}`;
  map.attributionControl.setPrefix(false).addAttribution(credit.outerHTML);
  new ResizeObserver(() => map.invalidateSize({pan: false})).observe(map.getContainer());
  // The whole page has light or dark colours like its map.
  map.on("semsig-colours", () => document.body.classList.toggle("dark", semsig.isDark(map)));
  semsig.colours(map);
  return map;
};
// Adds the streets, if there are any, and the search of maps.
semsig.showGround = async (map) => {
  const streets = await (await semsig.api("ground")).json();
  map.semsigArea = streets.area;
  semsig.search(map, streets.area);
  if (streets.ground) semsig.ground(...streets.ground).addTo(map);
};
// The workbench has no panel: a search result is marked with its name until the map is clicked.
semsig.show = (map, box, place, {drawn}) => {
  semsig.marker?.remove();
  semsig.marker = L.layerGroup([drawn, L.tooltip(place, {
    content: box.querySelector("h2"), permanent: true, direction: "top", offset: [0, -10]})])
    .addTo(map);
  map.once("click", () => semsig.marker.remove());
};
semsig.start = semsig.trying(async () => {
  const city = await (await semsig.api("city")).json();
  const session = new semsig.Session(city);
  const map = semsig.cityMap(city);
  const answer = new semsig.Answer(session, map);
  semsig.element("city").textContent = `${city.name}, ${city.cells.toLocaleString("en")} cells`;
  semsig.element("about").textContent = [...city.licences, "Map drawn by Leaflet"].join(" · ");
  semsig.palette(session);
  const noise = semsig.element("noise");
  const observers = {
    "by-hand": "a person, who misses some", generic: "any detector",
    photo: "a person or a detector, in photographs",
    panorama: "a person or a detector, in panoramas"};
  noise.append(...city.noise.map(
    (name) => new Option(observers[name] ?? `a detector with ${name} noise`, name)));
  session.noise = noise.value;
  noise.addEventListener("change", () => {
    session.noise = noise.value;
    session.changed();
  });
  semsig.element("from").addEventListener("change", (event) => {
    session.seenFrom = event.target.value;
    session.changed();
  });
  session.addEventListener("scene", () => {
    semsig.showScenes(session);
    semsig.showScene(session);
    semsig.showCamera(session);
    answer.draw();
    answer.showWheels();
  });
  session.addEventListener("change", () => semsig.showScene(session));
  map.on("semsig-colours", () => answer.draw());
  semsig.history(session);
  semsig.suggest(session);
  semsig.simulate(session, map);
  semsig.files(session);
  semsig.keys(session);
  session.show(null);
  session.notify("answer");
  Object.assign(semsig, {session, map});
  await semsig.showGround(map);
});
semsig.start();
