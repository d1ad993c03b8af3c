// The module of choices that the service makes from the library's tables: api/routes/page_routes.py.

export const FIGURES: Record<string, string>;
export const PLAN_FIGURES: string[];
export const FORMATS: Record<string, { title: string; holds: string; altitude_m: number; on_earth: boolean; mission: boolean }>;
export const SHAPES: Record<string, string>;
export const PILOTS: Record<string, string>;
export const OBJECTIVES: Record<string, string>;
export const MEANINGS: Record<string, string>;
export const TERMS: Record<string, string>;
export const ALTERNATIVES: string[][];
export const STUDIES: Record<string, any>;
export const ENDED: string[];
export const BRIEF: { groups: any[]; shared: string[] };
export const TILES: { url: string; attribution: string } | null;
