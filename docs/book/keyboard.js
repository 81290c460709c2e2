// What scrolls sideways can be reached and scrolled by keys. mdBook's switch of the chapters' list says whether it is
// open, as only a button may.
"use strict";
function reach() {
  for (const wide of document.querySelectorAll("main table, main .equation, main pre")) {
    if (wide.scrollWidth > wide.clientWidth) wide.tabIndex = 0;
    else wide.removeAttribute("tabindex");
  }
}
document.getElementById("mdbook-sidebar-toggle")?.setAttribute("role", "button");
addEventListener("load", reach);
addEventListener("resize", reach);
