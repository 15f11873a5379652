// A preprocessor of mdBook: formulas between $ and $$ become HTML, rendered by KaTeX while the book is built. A formula
// that KaTeX refuses fails the build. Finds KaTeX through the package.json that KATEX_HOME names.
import { createRequire } from "node:module";
import { resolve } from "node:path";
import { readFileSync } from "node:fs";

if (process.argv[2] === "supports") process.exit(0);
const home = process.env.KATEX_HOME;
if (!home) throw new Error("KATEX_HOME is not set: build the book with docs/build");
const katex = createRequire(resolve(home, "package.json"))("katex");

// Code first, so that a $ within it is none of ours; then formulas on lines of their own; then those in the text.
const PARTS = /(^(`{3,}|~{3,})[\s\S]*?^\2[^\n]*$|`[^`\n]*`)|\$\$([\s\S]+?)\$\$|\$(?!\s)((?:\\.|[^$\\])+?)(?<!\s)\$(?!\d)/gm;
// Markdown reads within inline HTML: its signs are written as entities there.
const entity = (sign) => `&#${sign.charCodeAt(0)};`;
let formulas = 0;

function render(tex, displayMode, place) {
  formulas += 1;
  try {
    const html = katex.renderToString(tex.replaceAll("°", "^\\circ "), { displayMode, throwOnError: true, strict: "error" });
    return html.replace(/\n/g, " ").replace(/[\\`*_|[\]~]/g, entity);
  } catch (error) {
    throw new Error(`${place}: ${error.message}`);
  }
}

function chapter({ Chapter }) {
  if (!Chapter) return;
  const before = formulas;
  Chapter.content = Chapter.content.replace(PARTS, (whole, code, _fence, display, inline) => {
    if (code !== undefined) return whole;
    return render(display ?? inline, display !== undefined, Chapter.path);
  });
  if (formulas > before) {
    const up = "../".repeat((Chapter.path ?? "").split("/").length - 1);
    Chapter.content = `<link rel="stylesheet" href="${up}katex/katex.min.css">\n\n${Chapter.content}`;
  }
  Chapter.sub_items.forEach(chapter);
}

const [, book] = JSON.parse(readFileSync(0, "utf8"));
(book.items ?? book.sections).forEach(chapter);
console.error(`${formulas} formulas`);
process.stdout.write(JSON.stringify(book));
