// What a mark may be: the classes of the city, the frequent ones first, any class of a family, or
// something unnamed.
semsig.kinds = ({city}) => [
  ...city.classes.filter(({share}) => share > 0), ...city.families.filter(({name}) => name),
  semsig.unnamed];
// These in groups with a title: those that are seen most often, then by family.
semsig.kindGroups = (session) => {
  const {city: {families}} = session;
  const kinds = semsig.kinds(session);
  const classes = kinds.filter(({symbol}) => symbol && symbol !== "?");
  if (!families.length) return [{title: "", items: kinds}];
  return [
    {title: "Seen most often", items: classes.slice(0, 8)},
    ...families.map((family) => ({
      title: family.heading,
      items: [...(family.name ? [family] : []),
        ...classes.filter((item) => item.family === family.name)]})),
    {title: "", items: [semsig.unnamed]}];
};
// The kinds with a name or another word that matches, the best first.
semsig.kindsLike = (session, text) => {
  const kinds = semsig.kinds(session);
  const names = kinds.map(({title, name, words = []}) =>
    semsig.plain([title, name.replaceAll("_", " "), ...words].join("\n")));
  return semsig.matches(names, semsig.plain(text), kinds.length).map(({at}) => kinds[at]);
};
// Asks for the class of a mark where it was clicked, or at the mark; a fresh mark and its class are
// one step of undo. Typing a `letter` begins the search.
semsig.askClass = (session, entry, event = null, fresh = false, letter = "") => {
  const [box, input, list] = ["classes", "class-search", "class-list"].map(semsig.element);
  let offers = [];
  let at = 0;
  const close = () => {
    if (box.hidden) return;
    box.hidden = true;
    document.removeEventListener("pointerdown", outside, true);
    document.querySelector("#picture .mark[aria-pressed=true]")?.focus({preventScroll: true});
  };
  const outside = ({target}) => { if (!box.contains(target)) close(); };
  const take = (item) => {
    close();
    if (!item || !session.entries.includes(entry)) return;
    entry.class = item.name;
    session.changed(fresh ? entry : null);
  };
  const choose = (number) => {
    at = number;
    list.querySelectorAll(".offer").forEach((item, index) => {
      item.setAttribute("aria-selected", String(index === at && offers.length > 0));
      if (index === at) item.scrollIntoView({block: "nearest"});
    });
    input.setAttribute("aria-activedescendant", offers.length ? `class-${at}` : "");
  };
  const look = () => {
    const groups = input.value ? [{title: "", items: semsig.kindsLike(session, input.value)}]
      : semsig.kindGroups(session);
    offers = groups.flatMap(({items}) => items);
    const optionOf = (item) => {
      const line = L.DomUtil.create("div", "offer", list);
      line.id = `class-${list.querySelectorAll(".offer").length - 1}`;
      line.setAttribute("role", "option");
      if (item) {
        line.dataset.name = item.name;
        line.append(semsig.sign(item));
      }
      semsig.text(line, "span", item?.title ?? "The city has no such class.");
      line.addEventListener("click", () => take(item));
    };
    list.replaceChildren();
    for (const {title, items} of groups) {
      if (title) {
        const heading = semsig.text(list, "div", title);
        heading.className = "heading";
        heading.setAttribute("role", "presentation");
      }
      items.forEach(optionOf);
    }
    if (!offers.length) optionOf(null);
    choose(0);
  };
  input.value = letter;
  input.oninput = look;
  box.onkeydown = (press) => {
    const step = {ArrowDown: 1, ArrowUp: -1}[press.key];
    if (step && offers.length) choose((at + step + offers.length) % offers.length);
    else if (press.key === "Enter" && offers.length) take(offers[at]);
    else if (press.key === "Escape" || press.key === "Tab") close();
    else return;
    press.preventDefault();
    press.stopPropagation();
  };
  box.hidden = false;
  look();
  const mark = document.querySelector("#picture .mark[aria-pressed=true]")?.getBoundingClientRect();
  const [x, y] = event ? [event.clientX + 14, event.clientY + 14]
    : mark ? [mark.right + 6, mark.top] : [0, 0];
  box.style.left = `${Math.max(Math.min(x, innerWidth - box.offsetWidth - 8), 8)}px`;
  box.style.top = `${Math.max(Math.min(y, innerHeight - box.offsetHeight - 8), 8)}px`;
  list.scrollTop = 0;
  // A keyboard on the screen of a phone would hide the list.
  if (!matchMedia("(pointer: coarse)").matches || letter) input.focus({preventScroll: true});
  document.addEventListener("pointerdown", outside, true);
};
