// Functions that tests call on a page with a map.

const map = Object.values(window).find((value) => value instanceof L.Map);

const shown = (test) => {
  const layers = [];
  map.eachLayer((layer) => test(layer) && layers.push(layer));
  return layers;
};

const circles = (colour) =>
  shown((layer) => layer instanceof L.CircleMarker && layer.options.fillColor === colour);

// The visible queries with an outcome, as signs.
const queries = (outcome) => {
  const { about, data, placeOf, selection } = semsig.layerSets.queries;
  return selection()
    .filter((index) => about.outcomes[data.outcome[index]].name === outcome)
    .map((index) => ({
      getLatLng: () => L.latLng(placeOf(index)),
      fire: () => semsig.openers.query(map, String(index + 1)),
    }));
};

// Signs by their colour, or queries by their outcome.
const signs = (kind) => (kind.startsWith("#") ? circles(kind) : queries(kind));

const lines = (test) => shown((layer) => layer.getLatLngs && test(layer));

// Calls back once the map has lain still for three frames: a zoom begins with the next one.
const atRest = (then, frames = 3) => {
  const moves = map._animatingZoom || map._panAnim?._inProgress;
  if (frames === 0) then();
  else requestAnimationFrame(() => atRest(then, moves ? 3 : frames - 1));
};

// Resolves when the arrays that the page has begun to unpack are ready.
const unpacked = () => Promise.all(window.unpacking);

// The text of the panel.
const panel = () => document.querySelector(".semsig-panel").innerText;

// The text of the panel after a click on a circle.
const content = (circle) => {
  circle.fire("click");
  return panel();
};

// The place of the panel.
const panelPlace = () => map.semsigPanel.selection.place;

const height = (element) => element.getBoundingClientRect().height;

// The number of pixels of about a colour on a canvas.
const drawn = (colour, selector) => {
  const canvas = document.querySelector(selector);
  if (canvas === null) return 0;
  const wanted = [1, 3, 5].map((at) => Number.parseInt(colour.slice(at, at + 2), 16));
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  let count = 0;
  for (let at = 0; at < data.length; at += 4) {
    const near = wanted.every((part, i) => Math.abs(data[at + i] - part) < 12);
    if (data[at + 3] > 200 && near) count += 1;
  }
  return count;
};

// Calls back with a function that returns the pixels of the field in a box of the screen.
const field = (call) => {
  const look = () => {
    const canvas = document.querySelector("canvas.semsig-field");
    const context = canvas.getContext("2d");
    const box = canvas.getBoundingClientRect();
    const shape = map.getContainer().getBoundingClientRect();
    const dots = canvas.width / box.width;
    const [left, top] = [shape.left - box.left, shape.top - box.top];
    call((x, y, size) =>
      context.getImageData(
        Math.round((x + left) * dots),
        Math.round((y + top) * dots),
        size,
        size,
      ),
    );
  };
  setTimeout(() => requestAnimationFrame(() => requestAnimationFrame(look)), 100);
};

// The colours of the field at places, each in the middle of the map.
const fieldAt = (places, zoom, done, colours = []) => {
  if (colours.length === places.length) return done(colours);
  map.setView(places[colours.length], zoom, { animate: false });
  return field((pixels) => {
    const { x, y } = map.latLngToContainerPoint(places[colours.length]);
    const [red, green, blue] = pixels(x, y, 1).data;
    fieldAt(places, zoom, done, [...colours, [red, green, blue]]);
  });
};

// The share of a square in the middle of the map that the field covers.
const fieldCover = (size, done) =>
  field((pixels) => {
    const { x, y } = map.getSize().divideBy(2);
    const { data } = pixels(x - size / 2, y - size / 2, size);
    done(data.filter((value, at) => at % 4 === 3 && value > 127).length / size ** 2);
  });

// The share of its box that the sign of an outcome covers.
const signArea = (outcome) => {
  const { outline } = semsig.layerSets.queries.about.outcomes.find(({ name }) => name === outcome);
  const size = outline.includes("A") ? 50 : 50 / 1.2;
  const { colour } = semsig.sprite(60, (ctx) => {
    ctx.scale(size, size);
    ctx.fill(new Path2D(outline));
  });
  return colour.length / 100 ** 2;
};

// The places of the first objects, which the search finds by their numbers.
const placesOfObjects = (count, done) => {
  const places = [];
  const look = () => {
    for (let number = 0; number < count; number += 1) {
      const name = semsig.finders
        .flatMap((finder) => finder(String(number), 99))
        .find((offer) => offer.name === String(number));
      if (!name) return setTimeout(look, 50);
      name.show(map);
      const place = panelPlace();
      places.push([place.lat, place.lng]);
    }
    return done(places);
  };
  look();
};

// Click a sign that is at a share of the half width from the middle.
const clickAt = (marker, side) => {
  const pan = map.panBy;
  map.panBy = (offset) => pan.call(map, offset, { animate: false });
  map.setView(marker.getLatLng(), 18, { animate: false });
  pan.call(map, [(side * map.getSize().x) / 2, 0], { animate: false });
  marker.fire("click");
};

// The positions of the objects in a wheel, relative to its middle.
const signPlaces = (wheel) =>
  [...wheel.querySelectorAll(".object > g")].map((sign) => {
    const { e, f } = sign.transform.baseVal.consolidate().matrix;
    return [e, f];
  });

// The places of the highlighted objects on the map.
const litPlaces = () =>
  shown((layer) => layer.getElement?.()?.matches?.(".semsig-object.lit")).map((layer) => {
    const { lat, lng } = layer.getLatLng();
    return [lat, lng];
  });

// The number of search results that are covered by something else.
const covered = () =>
  [...document.querySelectorAll("[role=option]")].filter((option) => {
    const box = option.getBoundingClientRect();
    return !option.contains(document.elementFromPoint(box.left + 10, box.top + box.height / 2));
  }).length;
