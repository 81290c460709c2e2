// Draws the equations, which are written as GitHub reads them too: blocks of language `math` (ci/book.py makes elements of
// their own of them), and $`…`$ within a line.
"use strict";
for (const source of document.querySelectorAll("pre.equation")) {
  const block = document.createElement("div");
  block.className = "equation";
  katex.render(source.textContent, block, { displayMode: true });
  source.replaceWith(block);
}
for (const code of document.querySelectorAll(":not(pre) > code")) {
  const before = code.previousSibling;
  const after = code.nextSibling;
  if (before?.nodeType !== Node.TEXT_NODE || after?.nodeType !== Node.TEXT_NODE) continue;
  if (!before.data.endsWith("$") || !after.data.startsWith("$")) continue;
  before.data = before.data.slice(0, -1);
  after.data = after.data.slice(1);
  const inline = document.createElement("span");
  katex.render(code.textContent, inline);
  code.replaceWith(inline);
}
