// Undo and redo by the keys that editors have for them.

const TYPED = ["text", "number", "password", "search"];

/** Undo and redo a store's edits by keyboard, unless text is being typed, which browsers undo themselves. */
export function listenForKeys(store) {
  document.addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.altKey || isTyping(event.target)) return;
    const letter = event.key.toLowerCase();
    const redo = letter === "y" || (letter === "z" && event.shiftKey);
    if (!redo && letter !== "z") return;
    event.preventDefault();
    if (redo) store.redo();
    else store.undo();
  });
}

function isTyping(target) {
  return target instanceof HTMLTextAreaElement || (target instanceof HTMLInputElement && TYPED.includes(target.type));
}
