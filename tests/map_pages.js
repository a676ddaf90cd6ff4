// What the tests ask a page about its one map.

const map = Object.values(window).find((value) => value instanceof L.Map);

const shown = (test) => {
  const layers = [];
  map.eachLayer((layer) => test(layer) && layers.push(layer));
  return layers;
};

const circles = (colour) =>
  shown((layer) => layer instanceof L.CircleMarker && layer.options.fillColor === colour);

const lines = (test) => shown((layer) => layer.getLatLngs && test(layer));

// What the panel says.
const panel = () => document.querySelector(".semsig-panel").innerText;

// What a circle says when it is clicked.
const content = (circle) => {
  circle.fire("click");
  return panel();
};

// The place that the panel tells of.
const toldPlace = () => map.semsigPanel.told.place;

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

// Where places are on the screen, and the colours of the heatmap there, mixed from the four pixels
// of the field around each.
const heat = (places, zoom, done) => {
  map.setZoom(map.getZoom() + zoom, { animate: false });
  const look = () => {
    const canvas = document.querySelector("canvas.semsig-heat");
    const copy = document.createElement("canvas");
    [copy.width, copy.height] = [canvas.width, canvas.height];
    const context = copy.getContext("2d", { willReadFrequently: true });
    context.drawImage(canvas, 0, 0);
    const box = canvas.getBoundingClientRect();
    const shape = map.getContainer().getBoundingClientRect();
    const colours = places.map((place) => {
      const { x, y } = map.latLngToContainerPoint(place);
      const [left, top] = [x + shape.left - box.left, y + shape.top - box.top];
      return [x, y, ...context.getImageData(Math.round(left), Math.round(top), 1, 1).data];
    });
    done(colours);
  };
  requestAnimationFrame(() => requestAnimationFrame(look));
};

// Where the first objects are that are called by their numbers.
const placesOfObjects = (count, done) => {
  const places = [];
  const look = () => {
    for (let one = 0; one < count; one += 1) {
      const name = semsig.finders
        .flatMap((finder) => finder(String(one), 99))
        .find((other) => other.name === String(one));
      if (!name) return setTimeout(look, 50);
      name.show(map);
      const place = toldPlace();
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

// How many offers of the search are covered by something else.
const covered = () =>
  [...document.querySelectorAll("[role=option]")].filter((one) => {
    const box = one.getBoundingClientRect();
    return !one.contains(document.elementFromPoint(box.left + 10, box.top + box.height / 2));
  }).length;
