// Dock and tags of the site in use: set by where the robot stands, by the map or by what the camera
// sees; shown on the map.

import { get, request } from "../core/link/api.js";
import { clearSent, make, reconcile, set, setText } from "../core/dom.js";
import { rounded } from "../core/geometry.js";
import { number, t } from "../core/text/language.js";
import { attempt } from "../core/toasts.js";
import { typedPose } from "../core/text/typed_pose.js";
import { isPlaceKnown, propose } from "../localisation/place.js";
import { overlays, redraw } from "../map/map.js";
import { askPose } from "../map/pointer/pick.js";
import { world } from "../map/world.js";
import { addGoal } from "../mission/goals.js";

const DOCK = "#ffd166";
const TAG = "#f78fb3";
const ARROW_M = 0.5;
// A site that has not been read yet: neither the dock nor the tags of another one are in force.
const unread = (name) => ({ name, dock: undefined, tags: [] });
let site = unread(null);

const degrees = (yaw) => number((yaw * 180) / Math.PI, 0);
const placeOf = ({ x_m: x, y_m: y, yaw_rad: yaw }) =>
  t("at {x}, {y}, facing {degrees}°", { x: number(x, 2), y: number(y, 2), degrees: degrees(yaw) });

const textOf = (tag) =>
  t("Tag {number}, {size} cm, {place}, {height} m high, known to {sigma} cm", {
    number: tag.id,
    size: number(100 * tag.size_m, 0),
    place: placeOf(tag),
    height: number(tag.z_m, 1),
    sigma: number(100 * tag.sigma_m, 0),
  });

// The site in use is another one, or has another name.
export function enter(name) {
  take(unread(name));
}

// The site in use may have changed.
export const load = () => takeAnswer("GET", "");

// Told of what is drawn and what the section shows.
let taken = () => {};

function take(read) {
  site = read;
  taken();
  redraw();
}

async function takeAnswer(method, path, body) {
  const { name } = site;
  const read = await request(method, `/sites/${encodeURIComponent(name)}${path}`, body);
  if (name === site.name) take(read); // else the robot is at another one by now
}

const setDock = (dock) => takeAnswer("PATCH", "", { dock });
const putTag = (tag) => takeAnswer("POST", "/tags", tag);
const removeTag = (number) => takeAnswer("DELETE", `/tags/${number}`);

const dockHere = make("button", { type: "button", "data-testid": "dock-here" }, t("The robot stands in it now"));
dockHere.onclick = () => {
  const { x_m, y_m, yaw_rad } = world.state.pose;
  attempt(() => setDock({ x_m: rounded(x_m), y_m: rounded(y_m), yaw_rad: rounded(yaw_rad) }));
};

// Where the robot does not know its place, its pose would be a dock somewhere else.
export function follow(state) {
  const isKnown = isPlaceKnown(state);
  const title = isKnown ? dockHere.textContent : t("The robot does not know its place");
  set(dockHere, { disabled: !isKnown, title });
}

// `hide` and `show` close and open the panel, which covers the map.
export function buildDockAndTags({ hide, show }) {
  // The pose that is typed in a form counts; without one, a click on the map gives the position, and
  // another one or a drag the direction.
  function takePose(form, { input }, words, then) {
    form.onsubmit = (event) => {
      event.preventDefault();
      const typed = input.value;
      if (typed.trim()) {
        attempt(async () => {
          const { x_m: x, y_m: y, yaw_rad: yaw } = typedPose(typed, { needsHeading: true });
          await then({ x_m: rounded(x), y_m: rounded(y), yaw_rad: rounded(yaw) });
          clearSent(input, typed);
        });
      } else {
        hide();
        askPose(words, (pose) => {
          attempt(() => then(pose));
          show();
        });
      }
    };
  }

  const button = (testId, text, onclick, title = text) =>
    make("button", { type: "button", title, "data-testid": testId, onclick }, text);

  const field = (testId, label, values) => {
    const input = make("input", { "data-testid": testId, ...values });
    return { input, label: make("label", { class: "field" }, label, input) };
  };
  const numberField = (testId, label, values) => field(testId, label, { type: "number", required: "", ...values });
  const poseField = (testId, label) => {
    const made = field(testId, label, { placeholder: t("or click the map") });
    made.label.classList.add("pose");
    return made;
  };

  const dockText = make("p", { role: "status", "data-testid": "dock-text" });
  const dockPlace = poseField("dock-place", t("Dock x, y in metres, heading in °"));
  const dockForm = make(
    "form",
    { class: "row tag-form", autocomplete: "off" },
    dockPlace.label,
    make("button", { "data-testid": "dock-set" }, t("Set the dock …")),
  );
  takePose(
    dockForm,
    dockPlace,
    t("Click the middle of the robot in its dock, then the direction in which it faces."),
    setDock,
  );
  const dockDrive = button("dock-drive", t("Drive there"), () =>
    addGoal([site.dock.x_m, site.dock.y_m], site.dock.yaw_rad),
  );
  const dockIn = button("dock-in", t("The robot is in it"), () => {
    hide();
    propose(site.dock);
  }, t("Tell the robot that it is in the dock, if it does not know where it is"));
  const dockRemove = button("dock-remove", "✕", () => attempt(() => setDock(null)), t("Remove the dock"));

  const tagList = make("ul", { class: "list", "data-testid": "tags" });
  const noTags = make(
    "p",
    { class: "empty" },
    t("No tags yet. An AprilTag of the family 36h11 on a wall tells the robot where it is whenever it sees one."),
  );
  const seenList = make("ul", { class: "list", "data-testid": "seen-tags" });
  const seenNote = make("p", { class: "empty", role: "status", "data-testid": "seen-note" });
  const size = numberField("tag-size", t("Side of the black square, cm"), { value: 30, min: 1, max: 1000, step: 0.1 });
  const id = numberField("tag-number", t("Number"), { min: 0, max: 586, step: 1, placeholder: 12 });
  const height = numberField("tag-height", t("Height of its middle, m"), { value: 0.6, min: 0, max: 20, step: 0.01 });
  const place = poseField("tag-place", t("Tag x, y in metres, heading in °"));
  const look = button("tags-look", t("Tags in view"), () =>
    attempt(async () => {
      const seen = await get(`/tags/seen?size_m=${size.input.valueAsNumber / 100}`);
      setText(seenNote, seen.length ? "" : t("The camera sees no tag now. Stand one to three metres before it."));
      seenList.replaceChildren(...seen.map(seenItem));
    }),
  );

  function seenItem({ tag, known }) {
    const text = known ? t("Replace") : t("Add");
    const add = button("tag-add", text, () => {
      attempt(() => putTag(tag));
      add.closest("li").remove();
    }, `${text}: ${tag.id}`);
    return make("li", { "data-testid": "seen-tag" }, make("span", { class: "label" }, textOf(tag)), add);
  }

  function tagItem(tag) {
    const remove = button(
      "tag-remove",
      "✕",
      () => attempt(() => removeTag(tag.id)),
      t("Remove tag {number}", { number: tag.id }),
    );
    remove.setAttribute("aria-label", remove.title);
    return make("li", { "data-testid": "tag" }, make("span", { class: "label" }), remove);
  }

  const form = make(
    "form",
    { class: "row tag-form", autocomplete: "off" },
    size.label,
    look,
    id.label,
    height.label,
    place.label,
    make("button", { "data-testid": "tag-set" }, t("Set a tag …")),
  );
  takePose(form, place, t("Click where the tag is, then the direction in which it faces."), (pose) => {
    const tag = {
      id: id.input.valueAsNumber,
      z_m: height.input.valueAsNumber,
      size_m: rounded(size.input.valueAsNumber / 100),
    };
    return putTag({ ...tag, ...pose });
  });

  taken = () => {
    const { dock, tags } = site;
    setText(
      dockText,
      dock
        ? t("The dock is {place}.", { place: placeOf(dock) })
        : dock === null
          ? t("No dock yet: the place where the robot stands while it charges. In it, one click tells the robot where it is.")
          : "",
    );
    for (const one of [dockDrive, dockIn, dockRemove]) one.hidden = !dock;
    reconcile(tagList, tags, (tag) => tag.id, tagItem, (item, tag) =>
      setText(item.querySelector(".label"), textOf(tag)),
    );
    noTags.hidden = dock === undefined || tags.length > 0;
  };
  taken();
  return make(
    "section",
    { "aria-label": t("Dock and tags"), "data-testid": "dock-tags" },
    make("h2", {}, t("Dock and tags")),
    dockText,
    make("div", { class: "row" }, dockHere, dockDrive, dockIn, dockRemove),
    dockForm,
    tagList,
    noTags,
    form,
    seenNote,
    seenList,
  );
}

overlays.push(({ line, dot, placeLabel, toPage }) => {
  const mark = ({ x_m: x, y_m: y, yaw_rad: yaw }, colour, text) => {
    const tip = [x + ARROW_M * Math.cos(yaw), y + ARROW_M * Math.sin(yaw)];
    line([[x, y], tip], colour, 2);
    dot([x, y], 5, colour, { diamond: true });
    const [px, py] = toPage([x, y]);
    placeLabel(text, [px, py + 14], { colour });
  };
  if (site.dock) mark(site.dock, DOCK, t("dock"));
  for (const tag of site.tags) mark(tag, TAG, t("tag {number}", { number: tag.id }));
});
