// Requests to the service: a refusal and a lost connection are different errors.

import { notice } from "./elements.js";

const STORED_KEY = "syncplan-key";
const RETRY_S = [0.5, 1, 2, 4, 4];

/** The service answered, with a problem document. */
export class Refusal extends Error {
  constructor(status, problem) {
    super(problem.detail || problem.title || `status ${status}`);
    this.status = status;
    this.faults = problem.errors || [];
  }
}

/** There is no plan by an identifier, as far as the service reports. */
export class NoPlan extends Refusal {}

/** No answer: the service is away, or the connection is. */
export class Unreachable extends Error {}

export const key = {
  get: () => sessionStorage.getItem(STORED_KEY) || "",
  set: (value) => sessionStorage.setItem(STORED_KEY, value),
};

/** Return the answer to a request; throws Refusal, Unreachable, or AbortError.
 * @param {string} method
 * @param {string} path
 * @param {{body?: string | Blob, type?: string, accept?: string, headers?: Record<string, string>, signal?: AbortSignal}} options */
export async function ask(method, path, { body, type, accept, headers, signal } = {}) {
  /** @type {Record<string, string>} */
  const sent = { Accept: accept || "application/json", ...headers };
  const shown = key.get();
  if (shown) sent.Authorization = `Bearer ${shown}`;
  if (body !== undefined) sent["Content-Type"] = type || "application/json";
  let answer;
  try {
    answer = await fetch(path, { method, headers: sent, body, signal, cache: "no-cache" });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Unreachable("the service can't be reached");
  }
  if (answer.status === 401) {
    // a key that was entered meanwhile is another question
    if (key.get() !== shown) return ask(method, path, { body, type, accept, headers, signal });
    document.dispatchEvent(new Event("syncplan:key"));
    throw new Refusal(401, { detail: "This service needs a key. Enter yours to continue." });
  }
  if (!answer.ok) throw new Refusal(answer.status, await problemOf(answer));
  return answer;
}

/** Return the JSON of an answer. */
export async function askJson(method, path, options) {
  const answer = await ask(method, path, options);
  try {
    return await answer.json();
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Unreachable("the service's answer was cut short");
  }
}

/** Post a value as JSON, or a text as YAML, once, however often the connection has to be tried: by its Idempotency-Key. */
export function postOnce(path, value) {
  const headers = { "Idempotency-Key": crypto.randomUUID ? crypto.randomUUID() : randomName() };
  const text = typeof value === "string";
  const body = text ? value : JSON.stringify(value);
  return patiently(() => askJson("POST", path, { body, type: text ? "application/yaml" : undefined, headers }));
}

/** Throw what a request for a plan failed with, in words where there is no such plan. */
export function noSuchPlan(error) {
  const malformed = error instanceof Refusal && error.faults.some((one) => one.path === "path.plan_id");
  if (error.status !== 404 && !malformed) throw error;
  throw new NoPlan(error.status, { detail: "There is no such plan, or it belongs to another key." });
}

/** Return the answer to a request, repeated while the service is away; a notice says so at once. */
export async function patiently(request) {
  let noticed = false;
  try {
    for (const wait of RETRY_S) {
      try {
        return await request();
      } catch (error) {
        if (!passing(error)) throw error;
        notice(`${error.message}; trying again …`, { fault: true });
        noticed = true;
        await pause(wait);
      }
    }
    return await request();
  } finally {
    if (noticed) notice("");
  }
}

/** Whether asking again later may help. */
export function passing(error) {
  return error instanceof Unreachable || (error instanceof Refusal && error.status === 503);
}

export function pause(seconds) {
  return new Promise((resolve) => setTimeout(resolve, 1000 * seconds));
}

async function problemOf(answer) {
  try {
    return await answer.json();
  } catch {
    return { title: `status ${answer.status}` };
  }
}

// crypto.randomUUID exists on secure origins only
function randomName() {
  return [...crypto.getRandomValues(new Uint8Array(16))]
    .map((one) => one.toString(16).padStart(2, "0"))
    .join("");
}
