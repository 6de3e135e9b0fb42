// Excerpts of a search from disk: there a page may not read another, so their texts come from one script.
if (location.protocol === "file:" && /\/search\.html$/.test(location.pathname)) {
  const texts = new Promise((done) => {
    const script = document.createElement("script");
    script.src = new URL("_static/texts.js", location.href).href;
    script.onload = () => done(window.partitaTexts);
    script.onerror = () => done({});
    document.head.append(script);
  });
  const root = new URL(".", location.href).href, asked = window.fetch.bind(window);
  window.fetch = async (address, ...rest) => {
    const url = new URL(address, location.href).href.replace(/[?#].*$/, "");
    const found = url.startsWith(root) && (await texts)[decodeURIComponent(url.slice(root.length))];
    if (!found) return asked(address, ...rest);
    const page = document.createElement("div"), main = document.createElement("div");
    main.setAttribute("role", "main");
    for (const [anchor, text] of found) {
      const piece = document.createElement("section");
      if (anchor) piece.id = anchor;
      piece.textContent = `${text} `;
      main.append(piece);
    }
    page.append(main);
    return new Response(page.innerHTML);
  };
}
