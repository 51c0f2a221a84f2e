// A browser starts no worker from a file: where a page is opened as one, its search runs in a
// hidden frame in place of a worker. Messages are copied, as between threads: the search changes
// those that it gets. Over HTTP this does nothing.
if (location.protocol === "file:") {
  window.Worker = class {
    constructor(url) {
      const frame = (this.frame = document.createElement("iframe"));
      frame.hidden = true;
      this.ready = new Promise((loaded) => {
        frame.onload = () => {
          const inside = frame.contentWindow;
          inside.postMessage = (data) => this.onmessage?.({ data: structuredClone(data) });
          const script = inside.document.createElement("script");
          script.onload = () => loaded(inside);
          script.src = url;
          inside.document.head.append(script);
        };
      });
      document.documentElement.append(frame);
    }
    postMessage(data) {
      const copy = structuredClone(data);
      this.ready.then((inside) => inside.onmessage({ data: copy }));
    }
    terminate() {
      this.frame.remove();
    }
  };
}
