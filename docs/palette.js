// The theme stores the palette of every visit, so that a page no longer follows the system. Here
// only a palette that the reader clicked is stored.
let clicked = false;
addEventListener("change", (event) => (clicked ||= event.isTrusted && event.target.name === "__palette"), true);
const store = Storage.prototype.setItem;
Storage.prototype.setItem = function (key, value) {
  if (clicked || !key.endsWith(".__palette")) store.call(this, key, value);
};
