// List of the marks on the shown picture: values, names, and buttons to remove them.

import { letGo } from "./accessibility.js";
import { caption, COLOURS } from "./calipers.js";

export class MarkList {
  /** `on`: { name(caliper, name), remove(mark) }. */
  constructor(section, on) {
    this.section = section;
    this.list = section.querySelector("ol");
    this.on = on;
    this.rows = new Map();
    /** Measures of the scene: { name, title, kind }. */
    this.measures = [];
  }

  /** Stores the measures after which measurements can be named. */
  offer(measures) {
    this.measures = measures;
    this.rows.clear();
    this.list.replaceChildren();
  }

  /** Shows the calipers and texts of a picture. */
  show(calipers, texts) {
    const marks = [...calipers, ...texts];
    this.section.hidden = marks.length === 0;
    const rows = marks.map((mark) => this.rows.get(mark) ?? this.row(mark));
    this.rows = new Map(marks.map((mark, i) => [mark, rows[i]]));
    marks.forEach((mark, i) => this.update(rows[i], mark, i));
    // Rows that don't change keep the focus.
    const wanted = rows.map(({ item }) => item);
    if (wanted.length !== this.list.children.length || wanted.some((item, i) => this.list.children[i] !== item)) {
      this.list.replaceChildren(...wanted);
    }
  }

  row(mark) {
    const item = document.createElement("li");
    const text = document.createElement("span");
    const remove = document.createElement("button");
    remove.textContent = "×";
    remove.addEventListener("click", () => this.on.remove(mark));
    const names = mark.tool ? this.names(mark) : null;
    item.append(...[names, text, remove].filter(Boolean));
    return { item, text, remove, names };
  }

  /** A choice of the measures that fit the caliper's tool; null if there are none. */
  names(caliper) {
    const fitting = this.measures.filter(({ kind }) => kind === caliper.tool);
    if (fitting.length === 0) return null;
    const names = document.createElement("select");
    const option = ({ name, title }) => Object.assign(new Option(name, name), { title });
    names.append(new Option("unnamed", ""), ...fitting.map(option));
    names.addEventListener("change", () => {
      this.on.name(caliper, names.value);
      letGo(names);
    });
    names.addEventListener("keydown", (event) => {
      if (event.key === "Escape") names.blur();
      event.stopPropagation();
    });
    return names;
  }

  update({ item, text, remove, names }, mark, index) {
    const shown = mark.tool ? caption({ ...mark, name: names ? "" : mark.name }) : `“${mark.text}”`;
    if (text.textContent !== shown) text.textContent = shown;
    item.style.color = mark.tool ? COLOURS[index % COLOURS.length] : "";
    const what = mark.tool ? `measurement ${index + 1}` : `the text ${mark.text}`;
    remove.setAttribute("aria-label", `Remove ${what}`);
    if (!names) return;
    names.setAttribute("aria-label", `Measurement ${index + 1} is`);
    if (names.value !== mark.name) names.value = mark.name;
    names.title = this.measures.find(({ name }) => name === mark.name)?.title ?? "Name of the measurement";
  }
}
