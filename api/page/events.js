// A job's server-sent events by fetch: EventSource could not send a key.

import { ask, pause, Refusal, Unreachable } from "./service.js";
import { ENDED } from "./tables.js";

const RETRY_S = 1;
const TOO_MANY = 429;

/** Call `changed(event)` for every change of a job until it has ended, whatever the connection does.
 *
 * `away(true)` is called while the service can't be reached, `away(false)` once it is back.
 */
export async function follow(jobId, { changed, away }) {
  let last = "0";
  let ended = false;
  while (!ended) {
    try {
      const answer = await ask("GET", `v1/jobs/${jobId}/events`, {
        accept: "text/event-stream",
        headers: { "Last-Event-ID": last },
      });
      away(false);
      for await (const event of eventsOf(answer.body)) {
        last = event.id ?? last;
        const job = JSON.parse(event.data);
        changed(job);
        ended = ENDED.includes(job.state);
      }
    } catch (error) {
      // a stream that breaks off is a TypeError
      const passing = error instanceof Unreachable || error instanceof TypeError;
      const refused = error instanceof Refusal ? error.status : 0;
      if (!passing && refused < 500 && refused !== TOO_MANY) throw error;
      away(refused !== TOO_MANY);
    }
    if (!ended) await pause(RETRY_S);
  }
}

async function* eventsOf(stream) {
  const reader = stream.pipeThrough(new TextDecoderStream()).getReader();
  let text = "";
  while (true) {
    const { value, done } = await reader.read();
    if (done) return;
    text += value.replaceAll("\r\n", "\n");
    const blocks = text.split("\n\n");
    text = blocks.pop() ?? "";
    for (const block of blocks) {
      const [id, data] = ["id", "data"].map((field) => block.match(new RegExp(`^${field}: ?(.*)$`, "m"))?.[1]);
      if (data !== undefined) yield { id, data };
    }
  }
}
