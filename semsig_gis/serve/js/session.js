// The state of the workbench: views, their answer, and the requests to the server.
semsig.api = async (path, body, signal) => {
  const token = new URLSearchParams(location.search).get("token");
  const plain = body === undefined || body instanceof Blob;
  let response;
  try {
    response = await fetch(`/api/${path}`, {
      method: body === undefined ? "GET" : "POST",
      headers: {"X-Semsig-Token": token, ...(plain ? {} : {"Content-Type": "application/json"})},
      body: plain ? body : JSON.stringify(body),
      signal,
    });
  } catch {
    throw new Error("The server does not answer; is semsig serve still running?");
  }
  if (response.ok) return response;
  const {error} = await response.json().catch(() => ({}));
  throw Object.assign(new Error(error || `The server answered with status ${response.status}.`),
    {status: response.status});
};
// What is in the file of a session: functions that say whether a value is as the page saves it.
semsig.sessionParts = (() => {
  const within = (low, high) => (value) => Number.isFinite(value) && value >= low && value <= high;
  const maybe = (check) => (value) => (value ?? null) === null || check(value);
  const among = (...values) => (value) => values.includes(value);
  const text = (value) => typeof value === "string";
  const list = (check) => (value) => Array.isArray(value) && value.every(check);
  const row = (...checks) => (value) => Array.isArray(value) && value.length === checks.length
    && checks.every((check, at) => check(value[at]));
  const table = (checks) => (value) => value instanceof Object
    && Object.entries(checks).every(([key, check]) => check(value[key]));
  const degrees = within(-360, 360);
  const metres = within(-1e6, 1e6);
  const pixel = within(-1e6, 1e6);
  const side = within(1, 1e6);
  const [lat, lon] = [within(-90, 90), degrees];
  const seen = {class: text, text: maybe(text),
    range: maybe((value) => metres(value) || among("near", "middle", "far")(value))};
  const error = maybe((value) => value === "unknown" || degrees(value));
  const mark = (value) => table(seen)(value) && (value.box
    ? row(pixel, pixel, pixel, pixel)(value.box) : pixel(value.x) && pixel(value.y));
  const photo = table({marks: list(mark), width: side, height: side, name: maybe(text),
    fov: maybe(degrees), heading: maybe(degrees), heading_error: error, place: maybe(row(lat, lon)),
    projection: among("pinhole", "equirectangular", "cylindrical", "fisheye")});
  const step = maybe(table({bearing: degrees, metres}));
  const compass = table({step, heading_error: error, compass: list(table({...seen, bearing: degrees})),
    sectors: maybe(list(row(within(-360, 720), within(-360, 720))))});
  const photos = table({step, photos: (value) => list(photo)(value) && value.length > 0});
  const view = (value) => (value?.photos ? photos : compass)(value);
  return {views: list(view), truth: maybe(row(lat, lon)), near: maybe(row(lat, lon, within(0, 1e6))),
    noise: maybe(text), seen_from: among("anywhere", "cells"), absent: maybe(list(text))};
})();
semsig.Session = class extends EventTarget {
  constructor(city) {
    super();
    Object.assign(this, {city, noise: null, seenFrom: "anywhere", brush: null, asking: false,
      page: crypto.randomUUID(), closer: null, past: [], future: [], gesture: null,
      gestureScene: null});
    this.clear();
    this.present = this.savedPresent = this.state();
  }
  // What undo and redo restore, as text.
  state() {
    const {views, truth, absent, unsure, near} = this;
    return JSON.stringify({views, truth, absent, unsure, near});
  }
  // Whether marks or answers would be lost with the page.
  get unsaved() {
    const some = this.scenes.some((scene) => (scene.marks || scene.compass).length);
    return some && !this.truth && this.present !== this.savedPresent;
  }
  // Remembers the state before a change; the changes of one gesture in one scene are one step.
  remember(gesture) {
    const now = this.state();
    if (now === this.present) return;
    const same = gesture !== null && gesture === this.gesture && this.scene === this.gestureScene;
    if (!same) this.past.push(this.present);
    Object.assign(this, {present: now, future: [], gesture, gestureScene: this.scene});
  }
  undo() {
    this.goBack(this.past, this.future);
  }
  redo() {
    this.goBack(this.future, this.past);
  }
  goBack(from, to) {
    if (!from.length) return;
    const at = this.scenes.indexOf(this.scene);
    to.push(this.present);
    this.present = from.pop();
    Object.assign(this, JSON.parse(this.present), {gesture: null});
    this.show(this.scenes[at] ?? this.scenes.at(-1) ?? null);
    this.changed();
  }
  // A view is from one place and has photos or a compass; a scene is a photo or a compass.
  clear() {
    Object.assign(this, {
      views: [], scene: null, mark: null, answer: null, truth: null, chosen: 0, changedAt: 0,
      absent: [], unsure: [], near: null});
  }
  get scenes() {
    return this.views.flatMap((view) => view.photos || [view]);
  }
  get entries() {
    return this.scene ? this.scene.marks || this.scene.compass : [];
  }
  viewOf(scene) {
    return this.views.find((view) => view === scene || view.photos?.includes(scene));
  }
  show(scene, mark = null) {
    const moved = scene && this.scene && this.viewOf(scene) !== this.viewOf(this.scene);
    Object.assign(this, {scene, mark});
    this.notify("scene");
    if (moved) this.askAgain();
  }
  // A photo is added to the last place, unless it is some steps on; a compass is a new place.
  add(scene, {on = false} = {}) {
    const last = this.views.at(-1);
    const step = this.views.length ? {bearing: 0, metres: 20} : null;
    if (scene.compass) this.views.push({...scene, step});
    else if (last?.photos && !on) last.photos.push(scene);
    else this.views.push({photos: [scene], step});
    this.show(this.scenes.at(-1));
    this.changed();
  }
  remove(scene) {
    const view = this.viewOf(scene);
    if (view.photos) view.photos.splice(view.photos.indexOf(scene), 1);
    if (!view.photos?.length) this.views.splice(this.views.indexOf(view), 1);
    if (this.views.length) this.views[0].step = null;
    this.truth = null;
    if (this.isNear(scene)) this.near = null;
    this.show(this.scenes.at(-1) ?? null);
    this.changed();
  }
  // Whether the place of a photo is used for the first place.
  isNear({place}) {
    return Boolean(place && this.near) && place.every((part, at) => part === this.near[at]);
  }
  notify(what) {
    this.dispatchEvent(new Event(what));
  }
  changed(gesture = null) {
    this.remember(gesture);
    this.notify("change");
    this.askAgain();
  }
  askAgain() {
    this.changedAt = performance.now();
    this.closer?.abort();
    this.ask();
  }
  body() {
    const withoutFile = ({url, notes, fromFile, ...photo}) => photo;
    const views = this.views.map(
      (view) => (view.photos ? {...view, photos: view.photos.map(withoutFile)} : view));
    // The answer is about the place of the current scene.
    const view = this.scene ? views.findIndex((_, at) => this.views[at] === this.viewOf(this.scene))
      : null;
    return {
      views, view, top: 10, seen_from: this.seenFrom, noise: this.noise, truth: this.truth,
      absent: this.absent, near: this.near};
  }
  // One request at a time; changes during a request are sent next, so that the last state wins. A
  // request for a full answer, which is slow, is cancelled by a change, on the server as well.
  async ask() {
    if (this.asking) return;
    this.asking = true;
    const box = document.getElementById("answer");
    box.ariaBusy = "true";
    let requestedAt = null;
    while (requestedAt !== this.changedAt || this.answer?.quick) {
      // First a quick answer by cells, then, unless something changed meanwhile, the full answer.
      const quick = requestedAt !== this.changedAt;
      requestedAt = this.changedAt;
      const question = this.views;
      this.closer = quick ? null : new AbortController();
      let answer = {};
      try {
        if (this.scenes.some((scene) => (scene.marks || scene.compass).length)) {
          const body = {...this.body(), quick, page: this.page};
          answer = await (await semsig.api("answer", body, this.closer?.signal)).json();
        }
      } catch (error) {
        if (this.closer?.signal.aborted) requestedAt = null;
        answer = {error: error.message};
      }
      if (this.views !== question || requestedAt === null) continue;
      this.closer = null;
      Object.assign(this, {answer, chosen: 0, answeredAt: requestedAt, first: quick});
      this.notify("answer");
    }
    box.ariaBusy = null;
    this.asking = false;
  }
  saved() {
    const {name, fingerprint} = this.city;
    return {
      semsig: "session", version: 1, city: {name, fingerprint}, ...this.body(),
      answer: this.answer,
    };
  }
  // Restores a session from a file, which does not contain the photos.
  restore(saved) {
    if (saved?.semsig !== "session" || saved.version !== 1) {
      throw new Error("This file is not a session of the workbench; open one that it saved.");
    }
    const changed = Object.entries(semsig.sessionParts).find(([key, check]) => !check(saved[key]));
    if (changed) {
      throw new Error(`The ${changed[0]} of this session are not as the workbench saves them; open `
        + "the file as it was saved.");
    }
    if (saved.city?.fingerprint !== this.city.fingerprint) {
      throw new Error(`This session is about ${saved.city?.name}, and the server has `
        + `${this.city.name}; start semsig serve with that database.`);
    }
    this.clear();
    Object.assign(this, {
      views: saved.views, truth: saved.truth, noise: saved.noise, seenFrom: saved.seen_from,
      absent: saved.absent || [], near: saved.near ?? null});
    this.show(this.scenes[0] ?? null);
    this.changed();
    this.savedPresent = this.present;
  }
};
