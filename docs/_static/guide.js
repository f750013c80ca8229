/* A link into a folded part unfolds it. */
function unfold() {
  let node = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  const target = node;
  for (; node; node = node.parentElement) if (node.tagName === "DETAILS") node.open = true;
  if (target && target.closest("details")) target.scrollIntoView();
}
addEventListener("DOMContentLoaded", unfold);
addEventListener("hashchange", unfold);
// A module's name is broken at its dots.
addEventListener("DOMContentLoaded", () => {
  for (const { firstChild: name } of document.querySelectorAll("article h1, article h2, .page-info .title"))
    if (name?.data?.startsWith("seastar_gym."))
      name.replaceWith(...name.data.split(/(?<=\.)/).flatMap((part) => [part, document.createElement("wbr")]));
});
