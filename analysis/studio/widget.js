// What anywidget runs in a notebook: the page in a frame of its own, whose state is the model's.
function render({ model, el }) {
  const frame = document.createElement("iframe");
  // the page is a stranger to the notebook: nothing but its state goes between them
  frame.sandbox = "allow-scripts allow-downloads";
  frame.title = "Linkwork studio";
  frame.style.cssText = "width: 100%; border: 0; resize: vertical; overflow: hidden";
  frame.style.height = `${model.get("height")}px`;
  frame.srcdoc = model.get("page");
  let last = "";
  const put = () => {
    const text = JSON.stringify(model.get("state"));
    if (text === last) return;
    last = text;
    frame.contentWindow?.postMessage({ linkwork: model.get("state") }, "*");
  };
  const take = ({ source, data }) => {
    if (source !== frame.contentWindow || !data?.linkwork) return;
    if (data.linkwork === "ready") return put();
    last = JSON.stringify(data.linkwork);
    if (last === JSON.stringify(model.get("state"))) return;
    model.set("state", data.linkwork);
    model.save_changes();
  };
  addEventListener("message", take);
  model.on("change:state", put);
  el.append(frame);
  return () => {
    removeEventListener("message", take);
    model.off("change:state", put);
  };
}
export default { render };
