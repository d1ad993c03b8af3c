// The reader and writer of YAML 1.2 with merges, as the service reads it; the page loads them with the text of a brief.

import { CORE_SCHEMA, load as read, mergeTag } from "js-yaml";

export { dump } from "js-yaml";

/** Return the value of a text; throws where there is none.
 * @param {string} text
 * @returns {any} */
export const load = (text) => read(text, { schema: CORE_SCHEMA.withTags(mergeTag) });
