// The page of results without a question: a field for one, where the theme shows nothing.
if (/\/search\.html$/.test(location.pathname) && !new URLSearchParams(location.search).get("q")) {
  addEventListener("DOMContentLoaded", () => {
    const results = document.getElementById("search-results");
    if (!results || document.getElementById("search-field")) return;
    const form = document.createElement("form"), field = document.createElement("input"), button = document.createElement("button");
    const title = document.createElement("h1"), words = document.createElement("p");
    title.textContent = "Search";
    words.textContent = "Words of any page, names of methods, or what a message says.";
    Object.assign(field, { id: "search-field", name: "q", type: "search", autofocus: true });
    field.setAttribute("aria-label", "Words to search for");
    button.textContent = "Search";
    form.append(field, button);
    results.append(title, words, form);
    field.focus();
  });
}
