// The rows of the fault matrix as buttons, and what became of those that were pressed.

import type { Row } from "./data";
import { byId, element } from "./dom";
import { expectation, type Verdict } from "./verdict";

export class Matrix {
  private groups = new Map<string, Row[]>();
  private shown = "";

  constructor(private readonly inject: (row: Row, isFromItsStart: boolean) => void) {
    byId("find").addEventListener("input", () => this.list());
  }

  setRows(rows: readonly Row[]): void {
    this.groups = Map.groupBy(rows, (row) => row.group);
    this.list();
  }

  show(verdicts: readonly Verdict[]): void {
    const told = JSON.stringify(verdicts);
    if (told === this.shown) {
      return;
    }
    this.shown = told;
    byId("verdicts").replaceChildren(
      ...(verdicts.length === 0
        ? [element("p", { class: "muted" }, "Press a fault: it acts as soon as a current flows.")]
        : verdicts.toReversed().map((verdict) =>
            element(
              "article",
              { class: `verdict ${verdict.outcome.replaceAll(" ", "-")}` },
              element("h3", {}, element("span", { class: "badge" }, verdict.outcome), ` ${verdict.row}`),
              element("p", {}, element("b", {}, "should "), verdict.expected),
              element("p", {}, element("b", {}, "did "), verdict.seen),
              verdict.remarks.length === 0 ? null : element("p", {}, verdict.remarks.join("; ")),
            ),
          )),
    );
  }

  private list(): void {
    const wanted = byId<HTMLInputElement>("find").value.trim().toLowerCase();
    const groups = [...this.groups].filter(([, rows]) =>
      rows.some((row) => row.name.toLowerCase().includes(wanted)),
    );
    byId("rows").replaceChildren(...groups.map(([name, rows]) => this.entry(name, rows)));
  }

  private entry(name: string, rows: Row[]): HTMLLIElement {
    const choice = element("select", { "aria-label": `Which: ${name}` });
    choice.replaceChildren(
      ...rows.map((row, i) => new Option(row.name.slice(name.length + 2) || "–", String(i))),
    );
    const button = element("button", { type: "button" }, name);
    const chosen = () => rows[Number(choice.value)]!;
    const explain = () => {
      const { note } = chosen();
      button.title = expectation(chosen()) + (note === "" ? "" : `\n${note}`);
    };
    choice.addEventListener("change", explain);
    explain();
    button.addEventListener("click", () =>
      this.inject(chosen(), byId<HTMLInputElement>("as-matrix").checked),
    );
    return element("li", {}, button, rows.length > 1 ? choice : null);
  }
}
