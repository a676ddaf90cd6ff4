// The answer: as a sentence, on the map, as wheels, and the reasons for and against candidates.
semsig.coordinates = (place) => place.map((part) => part.toFixed(5)).join(", ");
semsig.away = (metres) => (metres < 1000
  ? `${Math.round(metres)} m` : `${(metres / 1000).toFixed(1)} km`);
semsig.percent = (share) => {
  if (share > 0.995) return "over 99\u00a0%";
  return share < 0.01 ? "under 1\u00a0%" : `${Math.round(100 * share)}\u00a0%`;
};
// The answer as a sentence.
semsig.sentence = ({answer, scenes}) => {
  if (!scenes.length) return "Nothing was seen yet: add a photo, a compass, or simulate a view.";
  if (answer?.error) return answer.error;
  if (!answer?.estimate) return "Nothing is marked yet: click what you see.";
  const {given, mass, radius, estimate, region, doubt, place_name: name} = answer;
  const where = semsig.coordinates(estimate.place) + (name ? ` (${name})` : "");
  const verdict = given
    ? `Within ${radius} m of ${where} with a chance of ${semsig.percent(mass)}.`
    : `Cannot tell yet. ${region.text}; within ${radius} m of the best the chance is `
      + `${semsig.percent(mass)}.`;
  const text = doubt ? `${verdict} ${doubt}` : verdict;
  if (!answer.truth) return text;
  const {found, metres, rank} = answer.truth;
  const outcome = given ? (found ? "Found" : "Wrong") : "Not found";
  const ranked = rank === null ? "" : `, whose cell has rank ${rank.toLocaleString("en")}`;
  return `${outcome}: the best place is ${semsig.away(metres)} from the true one${ranked}. ${text}`;
};
semsig.Answer = class {
  constructor(session, map) {
    Object.assign(this, {session, map, drawn: L.layerGroup().addTo(map), region: null});
    session.addEventListener("answer", () => this.show());
  }
  async show() {
    const {session, map} = this;
    const {answer, truth, city, answeredAt} = session;
    const shown = answer?.estimate ? answer : null;
    const box = document.getElementById("answer");
    box.className = !shown ? "" : shown.given ? "given" : "open";
    document.getElementById("sentence").textContent = semsig.sentence(session);
    document.getElementById("refining").hidden = !shown?.quick;
    const fov = document.getElementById("likeliest-fov");
    if (fov) fov.textContent = shown?.fov ? `Likeliest here: ${shown.fov}\u00b0.` : "";
    document.getElementById("notes").textContent = (shown?.notes || []).join(" ");
    this.showRegions(shown);
    this.choose(0);
    if (shown) {
      const {image, bounds} = shown.region;
      const region = L.imageOverlay(image, bounds, {
        pane: "tilePane", opacity: 0.85, className: "semsig-flip"});
      await new Promise((done) => {
        region.once("load", done).once("error", done).addTo(map);
      });
      this.region?.remove();
      this.region = region;
      if (session.answer !== answer) return;
      this.look(shown, truth);
    } else this.region = this.region?.remove() && null;
    await new Promise((done) => { requestAnimationFrame(done); });
    if (shown && answeredAt) {
      performance.measure(session.first ? "semsig-answer" : "semsig-closer",
        {start: answeredAt, end: performance.now()});
    }
    if (!shown?.quick) document.body.dataset.answered = answeredAt || 0;
    if (shown) box.dataset.city = city.name;
  }
  // Moves the map to the answer unless it is in view.
  look({given, estimate, candidates, region}, truth) {
    const places = given ? [estimate.place] : candidates.map((candidate) => candidate.place);
    if (truth) places.push(truth);
    const bounds = L.latLngBounds(places);
    const near = given ? L.latLngBounds(candidates[0].rays.map((ray) => ray.to)) : null;
    if (near?.isValid()) bounds.extend(near.pad(0.3));
    this.map.invalidateSize({pan: false});
    if (this.map.getBounds().contains(bounds) && (!given || this.map.getZoom() > 17)) return;
    this.map.fitBounds(given ? bounds : bounds.extend(region.bounds), {
      maxZoom: 19, padding: [30, 30], animate: false});
  }
  showRegions(answer) {
    const line = document.getElementById("regions");
    line.replaceChildren();
    for (const [share, count] of Object.entries(answer?.region.counts || {}).sort()) {
      const part = L.DomUtil.create("span", "", line);
      const swatch = L.DomUtil.create("i", "semsig-flip", part);
      swatch.style.background = answer.region.colours[share];
      part.append(`${100 * share} %${line.children.length > 1 ? "" : " of the chance"} in `
        + `${count.toLocaleString("en")} cell${count === 1 ? "" : "s"}`);
    }
  }
  choose(number) {
    this.session.chosen = number;
    this.draw();
    this.showCandidates();
    this.showReasons();
    this.showWheels();
  }
  // The scene and the mark of a ray, if the mark still exists.
  marked({mark}) {
    if (!mark) return [];
    const view = this.session.views[mark[0]];
    const scene = view?.photos ? view.photos[mark[1]] : view;
    return [scene, (scene?.marks || scene?.compass)?.[mark[2]]];
  }
  get candidate() {
    return this.session.answer?.candidates?.[this.session.chosen];
  }
  draw() {
    const {session, map, drawn} = this;
    drawn.clearLayers();
    const {candidates = [], estimate} = session.answer || {};
    const dark = semsig.outline(map);
    if (estimate) {
      L.polygon(estimate.ellipse, {color: dark, weight: 2, fill: false, interactive: false})
        .addTo(drawn);
    }
    for (const ray of this.candidate?.rays || []) {
      const {colour, text, ...look} = session.city.verdicts[ray.verdict];
      const [scene, mark] = this.marked(ray);
      const chosen = mark && mark === session.mark;
      if (chosen) look.weight = 6;
      L.polyline([ray.from, ray.to], {color: colour, ...look, interactive: false}).addTo(drawn);
      const item = session.city.classes.find(({name}) => name === ray.class) || semsig.unnamed;
      const html = L.DomUtil.create("div", `at ${ray.verdict}${chosen ? " chosen" : ""}`);
      html.append(semsig.sign(item));
      L.marker(ray.to, {
        icon: L.divIcon({html, className: "", iconSize: [22, 22]}), keyboard: false,
        zIndexOffset: chosen ? 900 : 0,
      }).bindTooltip(`${ray.title}: ${text}`).addTo(drawn)
        .on("click", () => { if (mark) session.show(scene, mark); });
    }
    for (const [at, candidate] of [...candidates.entries()].reverse()) {
      const chosen = at === session.chosen;
      const html = L.DomUtil.create("b", chosen ? "rank chosen" : "rank");
      html.textContent = candidate.rank;
      L.marker(candidate.place, {
        icon: L.divIcon({html, className: "", iconSize: [26, 26]}), zIndexOffset: 1000 - at,
        title: `Candidate ${candidate.rank}`, alt: `Candidate ${candidate.rank}`,
      }).on("click", () => this.choose(at)).addTo(drawn);
    }
    for (const photo of session.scenes.filter((scene) => scene.place)) {
      L.circleMarker(photo.place, {radius: 9, color: dark, weight: 3, dashArray: "3 4", fill: false})
        .bindTooltip(`place in the file of ${photo.name}`).addTo(drawn);
    }
    if (session.near) {
      const [lat, lng, radius] = session.near;
      L.circle([lat, lng], {radius, color: dark, weight: 2, dashArray: "3 4", fill: false,
        interactive: false}).addTo(drawn);
    }
    if (session.truth) {
      L.circleMarker(session.truth, {
        radius: 15, color: semsig.highlight, weight: 4, fill: false, interactive: false,
      }).bindTooltip("the true place", {permanent: true, direction: "bottom", offset: [0, 14]})
        .addTo(drawn);
    }
  }
  showCandidates() {
    const line = document.getElementById("candidates");
    line.replaceChildren(...(this.session.answer?.candidates || []).map((candidate, at) => {
      const button = L.DomUtil.create("button", "");
      button.type = "button";
      semsig.text(button, "b", candidate.rank);
      button.append(` ${semsig.percent(candidate.chance)}`);
      button.title = semsig.coordinates(candidate.place);
      button.setAttribute("aria-pressed", String(at === this.session.chosen));
      button.addEventListener("click", () => {
        this.choose(at);
        document.querySelectorAll("#candidates button")[at].focus();
        this.map.setView(candidate.place, Math.max(this.map.getZoom(), 18), {animate: false});
      });
      return button;
    }));
  }
  // Where the candidate is, and links to see it elsewhere.
  showSpot() {
    const line = document.getElementById("spot");
    const {candidate} = this;
    line.replaceChildren();
    if (!candidate) return;
    const {rank, place, place_name: name, links} = candidate;
    line.append([`Candidate ${rank}: ${semsig.coordinates(place)}`, name].filter(Boolean).join(", "));
    for (const [title, href] of Object.entries(links)) {
      line.append(" · ");
      const link = L.DomUtil.create("a", "", line);
      Object.assign(link, {href, target: "_blank", rel: "noopener noreferrer", textContent: title});
    }
  }
  showReasons() {
    const box = document.getElementById("speaks");
    const reasons = this.candidate?.for_against || [];
    this.showSpot();
    box.replaceChildren();
    for (const [title, sign] of [["for", 1], ["against", -1]]) {
      const counts = new Map();
      for (const {text, weight} of reasons) {
        if (sign * weight > 0.05) counts.set(text, (counts.get(text) || 0) + 1);
      }
      if (!counts.size) continue;
      const part = L.DomUtil.create("div", "", box);
      semsig.text(part, "h2", `Speaks ${title} candidate ${this.candidate.rank}`);
      const list = L.DomUtil.create("ul", "", part);
      for (const [text, count] of counts) {
        semsig.text(list, "li", count > 1 ? `${count} \u00d7 ${text}` : text);
      }
    }
  }
  // The marks, turned by the heading of the candidate, next to the street objects around it: each
  // ray of the answer is a mark, a street object, or both.
  showWheels() {
    const {session, candidate} = this;
    const {scene, city} = session;
    const box = document.getElementById("wheels");
    box.replaceChildren();
    const at = session.views.indexOf(scene && session.viewOf(scene));
    const view = session.answer?.views?.[at];
    if (!view || !candidate) return;
    const photo = Math.max(session.views[at].photos?.indexOf(scene) ?? 0, 0);
    const seen = candidate.rays.filter(({mark}) => mark?.[0] === at && mark[1] === photo);
    const there = candidate.rays.filter(({distance}) => distance !== null);
    const marked = session.views[at].photos?.filter((item) => item.marks.length);
    const own = marked ? marked.indexOf(scene) : 0;
    const look = (view.photos || [view])[own];
    if (!seen.length || !look) return;  // marks have changed since the answer
    const turn = candidate.headings[own] ?? 0;
    const turned = (degrees) => (degrees + turn + 720) % 360;
    const sectors = (look.sectors || []).map(([from, to]) => [
      turned(from), turned(from) + ((to - from + 360) % 360 || 360)]);
    const hidden = ({bearing}) => sectors.length
      && !sectors.some(([from, to]) => (bearing - from + 720) % 360 <= to - from);
    const outside = [...there.keys()].filter(
      (index) => !seen.includes(there[index]) && hidden(there[index]));
    const signature = (rays, [kind, degrees, metres], more = {}) => [
      rays.map((ray) => semsig.classNamed(session, ray[kind]).symbol).join(""),
      rays.map((ray) => Math.round(ray[degrees] + 360) % 360),
      {reach: city.reach, sectors, ...more,
        metres: rays.map((ray) => (ray[metres] === null ? null : Math.round(ray[metres])))}];
    const comparison = [
      seen.map((ray) => ({partner: there.indexOf(ray), verdict: ray.verdict})),
      there.map((ray, index) => ({
        partner: seen.indexOf(ray), verdict: outside.includes(index) ? "outside" : ray.verdict}))];
    const wheels = [
      semsig.wheel("Marked", signature(seen, ["seen_class", "seen_bearing", "seen_range"]),
        city.signs, comparison[0]),
      semsig.wheel(`At candidate ${candidate.rank}`,
        signature(there, ["class", "bearing", "distance"], {outside}), city.signs, comparison[1])];
    box.append(...wheels);
    this.connect(wheels, comparison);
  }
  // Highlights an object and its partner in both wheels while the mouse or the focus is on it.
  connect(wheels, comparison) {
    const objects = wheels.map((wheel) => [...wheel.querySelectorAll(".object")]);
    for (const [side, own] of objects.entries()) {
      for (const [index, object] of own.entries()) {
        const pair = [object, objects[1 - side][comparison[side][index].partner]];
        const light = (is) => () => {
          for (const other of pair) other?.classList.toggle("lit", is);
        };
        L.DomEvent.on(object, "mouseenter focus", light(true));
        L.DomEvent.on(object, "mouseleave blur", light(false));
      }
    }
  }
};
