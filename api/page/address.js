// What the page's address names: the plan on show, and the job and the design that are followed.

/** The address of a store's page: a reload goes on with what it names. */
export class Address {
  #store;
  /** the job: at work, or ended with its outcome on show; `finished` is the number of first trials that its figures are
   * of, while it runs, and `drawing` whether they are on their way
   * @type {{id: string, ended: boolean, finished?: number, drawing?: boolean} | null} */
  followed = null;
  /** the design on show @type {string | null} */
  designed = null;

  constructor(store) {
    this.#store = store;
    store.on(["opened", "scenario"], () => {
      // an outcome is of the plan before
      if (this.followed?.ended) this.followed = null;
    });
    store.on(["scenario"], () => this.write());
  }

  /** What the address names: `{ plan, job, design }`, each an identifier if there is one. */
  static get asked() {
    return Object.fromEntries(new URLSearchParams(location.search));
  }

  /** Write what is on show and followed; with `push` the browser's Back leads to what was before. */
  write({ push = false } = {}) {
    const named = { plan: this.#store.planId, job: this.followed?.id, design: this.designed };
    const text = new URLSearchParams(Object.entries(named).flatMap(([name, id]) => (id ? [[name, id]] : []))).toString();
    const query = text ? `?${text}` : "";
    const at = query || location.pathname;
    if (push) history.pushState(null, "", at);
    // browsers are slow at it, and a drag asks at every move
    else if (query !== location.search) history.replaceState(null, "", at);
  }
}
