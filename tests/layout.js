// What is wrong with the looks of a page of the documentation in a window of some width: a list of sentences.
() => {
  const found = new Set();
  const width = document.documentElement.scrollWidth;
  if (width > innerWidth) found.add(`the page is ${width} px wide`);
  const scrolls = (element) => {
    for (let above = element.parentElement; above; above = above.parentElement) {
      const style = getComputedStyle(above);
      if (/auto|scroll|hidden/.test(style.overflowX) || style.position === "fixed") return true;
    }
    return getComputedStyle(element).position === "fixed";
  };
  for (const element of document.querySelectorAll(".content *, .toc-drawer, .toc-drawer *")) {
    const box = element.getBoundingClientRect();
    if (box.width && box.height && box.right > innerWidth + 1 && !scrolls(element))
      found.add(`${element.tagName} ${element.className} ends at ${box.right} px`);
  }
  const parts = (colour) => colour.match(/[\d.]+/g).map(Number);
  const ground = (element) => {
    for (; element; element = element.parentElement) {
      const colour = parts(getComputedStyle(element).backgroundColor);
      if (colour.length < 4 || colour[3] > 0.5) return colour;
    }
    return [255, 255, 255];
  };
  // contrast by WCAG 2: 3 is the least for large letters
  const light = (colour) => {
    const [r, g, b] = colour.map((c) => (c / 255 <= 0.03928 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  for (const element of document.querySelectorAll(".content *")) {
    const own = [...element.childNodes].some((node) => node.nodeType === 3 && node.textContent.trim());
    if (!own || !element.getClientRects().length || element.closest(".headerlink, .visually-hidden, svg")) continue;
    const [dark, bright] = [parts(getComputedStyle(element).color), ground(element)].map(light).sort((a, b) => a - b);
    if ((bright + 0.05) / (dark + 0.05) < 3) found.add(`${element.tagName} ${element.className} can hardly be read`);
  }
  for (const picture of document.images)
    if (picture.complete && !picture.naturalWidth) found.add(`there is no ${picture.src}`);
  return [...found];
}
